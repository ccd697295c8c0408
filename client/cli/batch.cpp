#include "client/cli/batch.h"

#include <algorithm>
#include <array>
#include <functional>
#include <iterator>
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

fs::path common_folder(const fs::path& one, const fs::path& other) {
  fs::path common;
  const auto end = std::ranges::mismatch(one, other).in1;
  for (auto part = one.begin(); part != end; ++part) common /= *part;
  return common;
}

// The part of `path` below the folder that it is in.
fs::path without_folder(const fs::path& path, const fs::path& folder) {
  fs::path rest;
  for (auto part = std::next(path.begin(), std::distance(folder.begin(), folder.end()));
       part != path.end(); ++part) {
    rest /= *part;
  }
  return rest;
}

// The name in a file's name, cut so that a file can have it. `count` makes several of it.
std::string short_name(std::string_view name, int count) {
  constexpr std::size_t kLongest = 200;  // bytes: a file's name may have 255
  const std::string end = count > 1 ? '-' + std::to_string(count) : "";
  const std::string whole = plain(name);
  return std::string(beginning(whole, kLongest - end.size())) + end;
}

}  // namespace

std::string name_of_input(const fs::path& path) {
  if (path == "-") return "stdin";
  std::error_code absent;
  const fs::path whole = fs::absolute(path, absent).lexically_normal();
  const fs::path last = whole.has_filename() ? whole.filename() : whole.parent_path().filename();
  return plain((fs::is_directory(path, absent) ? last : without_suffixes(last)).string());
}

std::vector<std::string> names_of_members(const std::string& input,
                                          const std::vector<std::string>& members) {
  const auto file_of = [](const fs::path& member) {
    return without_suffixes(member.filename()).string();
  };
  std::map<std::string, fs::path> shared;  // by the names of files
  for (const fs::path member : members) {
    const auto [at, is_first] = shared.try_emplace(file_of(member), member.parent_path());
    if (!is_first) at->second = common_folder(at->second, member.parent_path());
  }
  const auto rest_of = [&](const fs::path& member) {
    return without_folder(member, shared.at(file_of(member)));
  };
  const std::array<std::function<std::string(const fs::path&)>, 3> forms = {
      file_of, [&](const fs::path& member) { return without_suffixes(rest_of(member)).string(); },
      [&](const fs::path& member) { return rest_of(member).string(); }};
  std::vector<std::string> names(members.size());
  std::set<std::string> given;
  for (const auto& form : forms) {
    const bool is_last = &form == &forms.back();
    std::map<std::string, std::vector<std::size_t>> alike;
    for (std::size_t n = 0; n < members.size(); ++n) {
      if (names[n].empty()) alike[short_name(input + '-' + form(members[n]), 1)].push_back(n);
    }
    for (const auto& [name, which] : alike) {
      if (!is_last && (which.size() > 1 || given.contains(name))) continue;
      for (const std::size_t n : which) {
        for (int count = 1; names[n].empty() || !given.insert(names[n]).second; ++count) {
          names[n] = short_name(input + '-' + form(members[n]), count);
        }
      }
    }
  }
  return names;
}

bool TakenNames::take(const std::string& name) {
  const std::scoped_lock lock(mutex_);
  return names_.insert(name).second;
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
