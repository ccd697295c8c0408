#include "client/cli/batch.h"

#include <algorithm>
#include <set>
#include <string_view>

#include "base/text.h"
#include "client/cli/ids.h"
#include "client/cli/options.h"
#include "client/isomesh/package.h"
#include "proto/error.h"

namespace isomesh::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kName = "{name}";

// The files that would be sent for `path`; `path` itself is the first.
std::vector<fs::path> sent_for(const fs::path& path) {
  std::vector<fs::path> files;
  if (path == "-" || fs::is_directory(path) || is_stored_volume(path)) return {path};
  for (const PackedFile& file : files_of_upload(path)) {
    files.push_back(file.path.lexically_normal());
  }
  return files;
}

// True if another input sends that file too: an earlier one in the list, or its header.
bool belongs_to_another(const std::vector<std::vector<fs::path>>& sent, std::size_t which) {
  const fs::path& own = sent[which].front();
  for (std::size_t other = 0; other < sent.size(); ++other) {
    if (other == which || std::ranges::find(sent[other], own) == sent[other].end()) continue;
    if (sent[other].size() > sent[which].size() || other < which) return true;
  }
  return false;
}

}  // namespace

std::string name_of_input(const fs::path& path) {
  if (path == "-") return "stdin";
  std::error_code absent;
  const fs::path whole = fs::absolute(path, absent).lexically_normal();
  const fs::path last = whole.has_filename() ? whole.filename() : whole.parent_path().filename();
  if (fs::is_directory(path, absent)) return last.string();
  const std::string suffix = lower(last.extension().string());
  const bool is_packed = suffix == ".gz" || suffix == ".bz2" || suffix == ".xz";
  const fs::path name = is_packed ? last.stem() : last;
  return name.stem().string();
}

std::vector<Input> inputs_of(const Options& options) {
  const auto& files = options.files;
  if (!is_by_name(options.outputs)) return {{files, name_of_input(files.front())}};
  std::vector<std::vector<fs::path>> sent;
  sent.reserve(files.size());
  for (const fs::path& file : files) sent.push_back(sent_for(file));
  std::vector<Input> inputs;
  std::set<std::string> names;
  for (std::size_t n = 0; n < files.size(); ++n) {
    if (belongs_to_another(sent, n)) continue;
    inputs.push_back({{files[n]}, name_of_input(files[n])});
    if (!names.insert(inputs.back().name).second) {
      wrong_usage("two inputs are called " + inputs.back().name +
                  ": one mesh would overwrite the other");
    }
  }
  return inputs;
}

bool is_by_name(const std::vector<Output>& outputs) {
  return std::ranges::any_of(outputs, [](const Output& output) {
    return output.path.string().find(kName) != std::string::npos;
  });
}

std::vector<Output> filled(const std::vector<Output>& outputs, const std::string& name) {
  std::string plain = name;
  std::ranges::replace(plain, '/', '_');
  std::vector<Output> result = outputs;
  for (Output& output : result) {
    std::string path = output.path.string();
    for (std::size_t at = 0; (at = path.find(kName, at)) != std::string::npos; at += plain.size()) {
      path.replace(at, kName.size(), plain);
    }
    output.path = path;
  }
  return result;
}

std::vector<MeshFormat> formats_of(const std::vector<Output>& outputs) {
  std::vector<MeshFormat> formats;
  for (const Output& output : outputs) {
    if (std::ranges::find(formats, output.format) == formats.end()) {
      formats.push_back(output.format);
    }
  }
  return formats;
}

}  // namespace isomesh::cli
