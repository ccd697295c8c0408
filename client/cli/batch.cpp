#include "client/cli/batch.h"

#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <set>
#include <string_view>
#include <utility>

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
  std::error_code unknown;
  if (path == "-" || fs::is_directory(path, unknown) || is_stored_volume(path)) return {path};
  std::vector<fs::path> files;
  try {
    for (const PackedFile& file : files_of_upload(path)) {
      files.push_back(file.path.lexically_normal());
    }
  } catch (const Error&) {
    // The upload of this input tells it.
    return {path};
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

fs::path without_suffixes(const fs::path& path) {
  const std::string suffix = lower(path.extension().string());
  const bool is_packed = suffix == ".gz" || suffix == ".bz2" || suffix == ".xz";
  return path.parent_path() / (is_packed ? path.stem() : path).stem();
}

// `name` in a file's name, which stays in its folder. An archive may name its members anyhow.
std::string plain(std::string_view name) {
  std::string text = printable(name);
  std::ranges::replace(text, '/', '_');
  return text;
}

}  // namespace

std::string name_of_input(const fs::path& path) {
  if (path == "-") return "stdin";
  std::error_code absent;
  const fs::path whole = fs::absolute(path, absent).lexically_normal();
  const fs::path last = whole.has_filename() ? whole.filename() : whole.parent_path().filename();
  if (fs::is_directory(path, absent)) return last.string();
  return without_suffixes(last).string();
}

std::vector<std::string> names_of_members(const std::string& input,
                                          const std::vector<std::string>& members) {
  const auto last = [](const std::string& member) { return fs::path(member).filename(); };
  const std::array<std::function<std::string(const std::string&)>, 3> forms = {
      [&](const std::string& member) { return without_suffixes(last(member)).string(); },
      [](const std::string& member) { return plain(without_suffixes(member).string()); },
      [](const std::string& member) { return plain(member); }};
  std::vector<std::string> names(members.size());
  for (const auto& form : forms) {
    std::map<std::string, int> counts;
    for (const std::string& member : members) ++counts[form(member)];
    for (std::size_t n = 0; n < members.size(); ++n) {
      const std::string name = form(members[n]);
      const bool is_last = &form == &forms.back();
      if (names[n].empty() && (is_last || counts[name] == 1)) names[n] = input + '-' + name;
    }
  }
  return names;
}

std::optional<std::string> TakenNames::take(const std::vector<std::string>& names) {
  const std::scoped_lock lock(mutex_);
  std::set<std::string> all = names_;
  for (const std::string& name : names) {
    if (!all.insert(plain(name)).second) return name;
  }
  names_ = std::move(all);
  return std::nullopt;
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
  const std::string in_path = plain(name);
  std::vector<Output> result = outputs;
  for (Output& output : result) {
    std::string path = output.path.string();
    for (std::size_t at = 0; (at = path.find(kName, at)) != std::string::npos;
         at += in_path.size()) {
      path.replace(at, kName.size(), in_path);
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
