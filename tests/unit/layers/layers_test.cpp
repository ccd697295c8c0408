// The layers of ARCHITECTURE.md: an include only ever points down.
#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

namespace {

namespace fs = std::filesystem;

// Folders that each layer may include besides itself; it may also include what those may include.
// To a layer outside it, a folder stands for all its subfolders too.
const std::map<std::string, std::vector<std::string>> kMayInclude = {
    {"base", {}},
    {"proto", {"base"}},
    {"server/mesh", {"proto"}},
    {"server/mesh/lattice", {"server/mesh"}},
    {"server/mesh/extract", {"server/mesh/lattice"}},
    {"server/mesh/topology", {"server/mesh"}},
    {"server/mesh/measure", {"server/mesh/topology"}},
    {"server/mesh/smooth", {"server/mesh/extract", "server/mesh/measure"}},
    {"server/mesh/labels", {"server/mesh/extract", "server/mesh/measure"}},
    {"server/mesh/walk", {"server/mesh/extract", "server/mesh/smooth"}},
    {"server/mesh/stairs", {"server/mesh/labels", "server/mesh/smooth"}},
    {"server/mesh/collapse", {"server/mesh/labels"}},
    {"server/volume", {"proto"}},
    {"server/codec/draco", {"server/mesh"}},
    {"server/codec/decode", {"server/mesh"}},
    {"server/codec", {"server/codec/draco", "server/codec/decode"}},
    {"server/store", {"proto"}},
    {"server/store/files", {"server/store"}},
    {"server/store/sql", {"server/store"}},
    {"server/store/audit", {"server/store/sql"}},
    {"server/store/sqlite", {"server/store/sql", "server/store/files"}},
    {"server/store/postgresql", {"server/store/sqlite"}},
    {"server/store/s3", {"server/store/files"}},
    {"server/process", {"server/volume"}},
    {"server/import/message", {"server/volume", "server/process"}},
    {"server/import/source", {"server/import/message"}},
    {"server/import/archives", {"server/import/source"}},
    {"server/import/labels", {"server/import/source"}},
    {"server/import/samples", {"server/import/labels"}},
    {"server/import/formats", {"server/import/samples"}},
    {"server/import/images", {"server/import/formats"}},
    {"server/import/dicom/elements", {"server/import/source"}},
    {"server/import/dicom/geometry", {"server/import/dicom/elements"}},
    {"server/import/dicom/pixels", {"server/import/dicom/geometry"}},
    {"server/import/dicom/kinds", {"server/import/dicom/pixels", "server/import/labels"}},
    {"server/import/dicom/contours", {"server/import/dicom/geometry", "server/import/labels"}},
    {"server/import/dicom/choosing", {"server/import/dicom/kinds", "server/import/dicom/contours"}},
    {"server/import/dicom", {"server/import/dicom/choosing", "server/import/samples"}},
    {"server/import/peers", {"server/import/dicom"}},
    {"server/import", {"server/import/peers", "server/import/archives", "server/import/images"}},
    {"server/hospital/protocol", {"proto"}},
    {"server/hospital/objects", {"server/hospital/protocol"}},
    {"server/hospital/dimse", {"server/process", "server/hospital/objects"}},
    {"server/hospital/records", {"server/store", "server/hospital/protocol"}},
    {"server/jobs/library", {"server/store", "server/codec", "server/import/message"}},
    {"server/jobs/making", {"server/jobs/library"}},
    {"server/jobs/queue", {"server/jobs/making"}},
    {"server/jobs", {"server/jobs/queue"}},
    {"server/hospital/orders", {"server/jobs", "server/hospital/dimse", "server/hospital/records"}},
    {"server/hospital/dicomweb", {"server/hospital/orders"}},
    {"server/hospital/c_store", {"server/hospital/orders", "server/net"}},
    {"server/hospital/worklist", {"server/hospital/orders"}},
    {"server/callbacks", {"server/store"}},
    {"server/net", {"proto"}},
    {"server/hospital/audit", {"server/store", "server/net"}},
    {"server/hospital",
     {"server/http", "server/hospital/audit", "server/hospital/dicomweb", "server/hospital/c_store",
      "server/hospital/worklist"}},
    {"server/http/requests", {"server/net", "server/store", "server/import/message"}},
    {"server/http/connections", {"server/http/requests"}},
    {"server/http/observe", {"server/callbacks", "server/jobs"}},
    {"server/http/oidc", {"server/http/requests"}},
    {"server/http/guards", {"server/http/connections", "server/http/observe", "server/http/oidc"}},
    {"server/http/responses", {"server/http/requests"}},
    {"server/http/app",
     {"server/http/guards", "server/http/responses", "server/callbacks", "server/jobs"}},
    {"server/http/routes", {"server/http/app"}},
    {"server/http", {"server/http/routes"}},
    {"server", {"server/hospital"}},
    {"client/isomesh", {"proto"}},
    {"client/cli", {"client/isomesh"}},
    {"server/hospital/client", {"client/isomesh", "server/hospital/protocol"}},
    {"server/hospital/command", {"client/cli", "server/hospital/client"}},
    {"client/mcp", {"client/cli"}},
    {"client/platforms", {"client/cli"}},
    {"client", {"server/hospital/command", "client/mcp", "client/platforms"}},
    {"client/verify", {"client/isomesh", "server/import/message"}},
    {"client/kernels", {"server/jobs/making", "server/import/source"}},
};

// The layer that a folder is, or is a part of; empty for a folder that is in none.
std::string layer_of(std::string folder) {
  while (!folder.empty() && !kMayInclude.contains(folder)) {
    folder = fs::path(folder).parent_path();
  }
  return folder;
}

bool is_in(const std::string& folder, const std::string& hall) {
  return folder == hall || folder.starts_with(hall + "/");
}

bool may_include(const std::string& layer, const std::string& included) {
  if (layer == included) return true;
  return std::ranges::any_of(kMayInclude.at(layer), [&](const std::string& below) {
    return may_include(below, included) || (is_in(included, below) && !is_in(layer, below));
  });
}

// The constants of a component, which stand beside its modules and know nothing: all may include
// them.
constexpr const char* kLimits = "limits.h";

struct Include {
  std::string file;
  std::string folder;    // of the file
  std::string included;  // the folder of what it includes
};

std::vector<Include> project_includes() {
  const fs::path root = ISOMESH_SOURCE_DIR;
  std::vector<Include> includes;
  for (const std::string top : {"base", "proto", "server", "client"}) {
    for (const auto& entry : fs::recursive_directory_iterator(root / top)) {
      const fs::path& path = entry.path();
      if (path.extension() != ".h" && path.extension() != ".cpp") continue;
      const fs::path relative = fs::relative(path, root);
      std::ifstream file(path);
      for (std::string line; std::getline(file, line);) {
        constexpr std::string_view kInclude = "#include \"";
        if (!line.starts_with(kInclude)) continue;
        const std::string name =
            line.substr(kInclude.size(), line.find('"', kInclude.size()) - kInclude.size());
        if (fs::path(name).filename() == kLimits) continue;
        includes.push_back({relative, relative.parent_path(), fs::path(name).parent_path()});
      }
    }
  }
  return includes;
}

TEST(Layers, IncludesPointDown) {
  const std::vector<Include> includes = project_includes();
  ASSERT_GT(includes.size(), 50U) << "the sources were not found";
  for (const auto& [file, folder, included] : includes) {
    const std::string layer = layer_of(folder);
    ASSERT_FALSE(layer.empty()) << folder << " is in no layer; add it to the list";
    EXPECT_TRUE(may_include(layer, layer_of(included)))
        << file << " includes something of " << included;
  }
}

// It checks what they make.
TEST(Layers, TheCheckerSharesNothingWithTheKernels) {
  for (const auto& [file, folder, included] : project_includes()) {
    EXPECT_FALSE(is_in(folder, "client/verify") && is_in(included, "server/mesh")) << file;
  }
}

TEST(Layers, LimitsKnowNothing) {
  for (const auto& [file, folder, included] : project_includes()) {
    EXPECT_NE(fs::path(file).filename(), kLimits) << file << " includes something of " << included;
  }
}

TEST(Layers, EveryLayerIsThere) {
  for (const auto& [layer, below] : kMayInclude) {
    EXPECT_TRUE(fs::is_directory(fs::path(ISOMESH_SOURCE_DIR) / layer)) << layer;
  }
}

TEST(Layers, OneFileOfTheServerKnowsTheHttpLibrary) {
  const fs::path root = ISOMESH_SOURCE_DIR;
  std::vector<std::string> users;
  for (const auto& entry : fs::recursive_directory_iterator(root / "server")) {
    std::ifstream file(entry.path());
    for (std::string line; std::getline(file, line);) {
      if (line.starts_with("#include <httplib.h>")) {
        users.push_back(fs::relative(entry.path(), root));
      }
    }
  }
  EXPECT_EQ(users, std::vector<std::string>{"server/http/connections/httplib_adapter.cpp"});
}

// The parser ends at a NUL byte; see there.
TEST(Layers, OneFileOfTheProductParsesJson) {
  const fs::path root = ISOMESH_SOURCE_DIR;
  std::vector<std::string> users;
  for (const std::string top : {"base", "proto", "server", "client"}) {
    for (const auto& entry : fs::recursive_directory_iterator(root / top)) {
      const fs::path& path = entry.path();
      if (path.extension() != ".h" && path.extension() != ".cpp") continue;
      std::ifstream file(path);
      const std::string text(std::istreambuf_iterator<char>(file), {});
      if (text.find("nlohmann") == std::string::npos) continue;
      constexpr std::array<std::string_view, 7> kParsing = {
          "Json::parse(", "json::parse(", "Value::parse(", "Sorted::parse(",
          "::accept(",    "sax_parse(",   "\"_json"};
      const bool parses = std::ranges::any_of(kParsing, [&](std::string_view parsing) {
        return text.find(parsing) != std::string::npos;
      });
      if (parses) users.push_back(fs::relative(path, root));
    }
  }
  EXPECT_EQ(users, std::vector<std::string>{"proto/json_text.h"});
}

// It replaces control characters, which a server could send to the terminal. The others write
// meshes, their own bars and lines, and JSON for a program.
TEST(Layers, TheConsoleOfTheCommandWritesItsTexts) {
  const fs::path root = ISOMESH_SOURCE_DIR;
  std::vector<std::string> writers;
  for (const std::string top : {"client/cli", "client/mcp", "server/hospital/command"}) {
    for (const auto& entry : fs::recursive_directory_iterator(root / top)) {
      std::ifstream file(entry.path());
      const std::string text(std::istreambuf_iterator<char>(file), {});
      for (const std::string_view name : {"std::cout", "std::cerr", "std::clog", "printf(stdout",
                                          "printf(stderr", "std::puts", "std::fputs"}) {
        if (text.find(name) == std::string::npos) continue;
        writers.push_back(fs::relative(entry.path(), root));
        break;
      }
    }
  }
  std::ranges::sort(writers);
  EXPECT_EQ(writers,
            (std::vector<std::string>{"client/cli/console.cpp", "client/cli/downloads.cpp",
                                      "client/cli/progress_bar.cpp", "client/mcp/server.cpp"}));
}

// So that it can be left out: see ISOMESH_HOSPITAL.
TEST(Layers, OneFileOfTheDaemonAndOneOfTheCommandKnowTheHospital) {
  std::vector<std::string> users;
  for (const auto& [file, folder, included] : project_includes()) {
    if (is_in(included, "server/hospital") && !is_in(folder, "server/hospital")) {
      users.push_back(file);
    }
  }
  std::ranges::sort(users);
  EXPECT_EQ(users, (std::vector<std::string>{"client/main.cpp", "server/wings.cpp"}));
}

TEST(Layers, KernelsKnowNoFilesNoJsonNoHttp) {
  for (const auto& entry :
       fs::recursive_directory_iterator(fs::path(ISOMESH_SOURCE_DIR) / "server/mesh")) {
    std::ifstream file(entry.path());
    for (std::string line; std::getline(file, line);) {
      for (const std::string_view header : {"<fstream>", "<filesystem>", "nlohmann", "httplib"}) {
        EXPECT_FALSE(line.starts_with("#include") && line.find(header) != std::string::npos)
            << entry.path().filename() << ": " << line;
      }
    }
  }
}

}  // namespace
