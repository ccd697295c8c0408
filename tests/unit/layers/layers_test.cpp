// The layers of ARCHITECTURE.md: an include only ever points down.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace {

namespace fs = std::filesystem;

// Lowest first. A folder may include itself and those before it on its own side of the wire.
const std::vector<std::string> kServerLayers = {"proto",        "server/mesh",  "server/volume",
                                                "server/codec", "server/store", "server/jobs",
                                                "server/http",  "server"};
const std::vector<std::string> kClientLayers = {"proto", "client/isomesh", "client/cli"};

// Folders that are a layer's own business: it and they include each other, nobody else does.
const std::map<std::string, std::string> kParts = {{"server/volume/dicom", "server/volume"}};

std::string layer_of(const std::string& folder) {
  const auto part = kParts.find(folder);
  return part == kParts.end() ? folder : part->second;
}

std::vector<std::string> layers_below(const std::string& folder) {
  for (const auto& layers : {kServerLayers, kClientLayers}) {
    const auto found = std::ranges::find(layers, folder);
    if (found != layers.end()) return {layers.begin(), found + 1};
  }
  return {};
}

struct Include {
  std::string file;
  std::string folder;    // of the file
  std::string included;  // the folder of what it includes
};

std::vector<Include> project_includes() {
  const fs::path root = ISOMESH_SOURCE_DIR;
  std::vector<Include> includes;
  for (const std::string top : {"proto", "server", "client"}) {
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
    const std::vector<std::string> below = layers_below(layer_of(folder));
    ASSERT_FALSE(below.empty()) << folder << " is in no layer; add it to the list";
    EXPECT_TRUE(std::ranges::count(below, layer_of(included)) == 1)
        << file << " includes something of " << included;
  }
}

TEST(Layers, PartsAreIncludedByTheirLayerOnly) {
  std::size_t seen = 0;
  for (const auto& [file, folder, included] : project_includes()) {
    if (!kParts.contains(included)) continue;
    ++seen;
    EXPECT_EQ(layer_of(folder), layer_of(included)) << file << " includes a part of another layer";
  }
  EXPECT_GT(seen, 0U) << "no part is there; the list names folders that are gone";
}

TEST(Layers, KernelsKnowNoFilesNoJsonNoHttp) {
  for (const auto& entry : fs::directory_iterator(fs::path(ISOMESH_SOURCE_DIR) / "server/mesh")) {
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
