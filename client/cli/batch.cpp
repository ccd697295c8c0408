#include "client/cli/batch.h"

#include <algorithm>
#include <array>
#include <functional>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include "base/text.h"
#include "client/cli/ids.h"
#include "client/cli/options.h"
#include "client/isomesh/package.h"
#include "proto/error.h"
#include "proto/volume_formats.h"

namespace isomesh::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kName = "{name}";
constexpr std::string_view kFolder = "{folder}";

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

constexpr std::string_view kPacked = ".gz .bz2 .xz .zip .tar .tgz";

// Removes the suffix of these that the name has, if more than that remains.
bool drop_suffix(std::string& name, std::string_view suffixes) {
  for (const std::string_view suffix : words(suffixes)) {
    if (name.size() <= suffix.size() || !lower(name).ends_with(lower(suffix))) continue;
    name.resize(name.size() - suffix.size());
    return true;
  }
  return false;
}

// Without the suffixes of volumes. What else follows a dot is part of a name: of a version, a UID.
fs::path without_suffixes(const fs::path& path) {
  std::string name = path.filename().string();
  while (drop_suffix(name, kPacked)) continue;
  const auto drops = [&](const VolumeFormat& format) { return drop_suffix(name, format.suffixes); };
  static_cast<void>(std::ranges::any_of(volume_formats(), drops));
  return path.parent_path() / name;
}

// `name` in a file's name, which stays in its folder. An archive may name its members anyhow.
std::string plain(std::string_view name) {
  std::string text = printable(name);
  std::ranges::replace(text, '/', '_');
  if (text == "." || text == "..") return std::string(text.size(), '_');  // folders
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

// Bytes of a name in a file's name, which may have 255.
constexpr std::size_t kLongest = 200;
// The same for inputs, which keep their names: only the longest suffix of a format comes behind.
constexpr std::size_t kLongestOfInputs = 250;

// The name in a file's name, cut so that a file can have it. `count` makes several of it.
std::string short_name(std::string_view name, int count, std::size_t longest = kLongest) {
  const std::string end = count > 1 ? '-' + std::to_string(count) : "";
  const std::string whole = plain(name);
  return std::string(beginning(whole, longest - end.size())) + end;
}

// The folder of an input or a member, and its name without suffixes.
struct Place {
  fs::path folder;
  fs::path file;
  fs::path stem;
};

struct Naming {
  std::string name;
  bool is_unique = false;
};

// The first of these names that no other place has: that of the file; the same with the folders
// below the one that all files of that name share; the same with its suffixes, which is the name
// also if it is not unique. `prefix` comes before them; they differ in their first `longest` bytes.
std::vector<Naming> namings_of(const std::vector<Place>& places, const std::string& prefix,
                               std::size_t longest) {
  std::map<fs::path, fs::path> shared;  // folders by the names of files
  for (const Place& place : places) {
    const auto [at, is_first] = shared.try_emplace(place.stem, place.folder);
    if (!is_first) at->second = common_folder(at->second, place.folder);
  }
  const auto rest_of = [&](const Place& place) {
    return without_folder(place.folder, shared.at(place.stem));
  };
  const std::array<std::function<fs::path(const Place&)>, 3> forms = {
      [](const Place& place) { return place.stem; },
      [&](const Place& place) { return rest_of(place) / place.stem; },
      [&](const Place& place) { return rest_of(place) / place.file; }};
  std::vector<Naming> namings(places.size());
  std::set<std::string> given;
  for (const auto& form : forms) {
    std::map<std::string, std::vector<std::size_t>> alike;
    for (std::size_t n = 0; n < places.size(); ++n) {
      if (namings[n].is_unique) continue;
      namings[n].name = prefix + form(places[n]).string();
      alike[short_name(namings[n].name, 1, longest)].push_back(n);
    }
    for (const auto& [name, which] : alike) {
      if (which.size() > 1 || !given.insert(name).second) continue;
      namings[which.front()].is_unique = true;
    }
  }
  return namings;
}

// Standard input and stored volumes are in no folder.
bool is_in_folder(const fs::path& path) { return path != "-" && !is_stored_volume(path); }

Place place_of(const fs::path& path) {
  if (!is_in_folder(path)) return {{}, path, name_of_input(path)};
  std::error_code absent;
  fs::path whole = fs::absolute(path, absent).lexically_normal();
  if (!whole.has_filename()) whole = whole.parent_path();
  const fs::path file = whole.filename();
  return {whole.parent_path(), file,
          fs::is_directory(path, absent) ? file : without_suffixes(file)};
}

// The path without control characters; slashes stay.
std::string printable_path(const fs::path& path) {
  std::string text;
  for (const fs::path& part : path) text += (text.empty() ? "" : "/") + printable(part.string());
  return text;
}

void give_names(std::vector<Input>& inputs) {
  std::vector<Place> places;
  std::optional<fs::path> common;
  for (const Input& input : inputs) {
    places.push_back(place_of(input.files.front()));
    if (!is_in_folder(input.files.front())) continue;
    const fs::path& folder = places.back().folder;
    common = common ? common_folder(*common, folder) : folder;
  }
  const std::vector<Naming> namings = namings_of(places, "", kLongestOfInputs);
  for (std::size_t n = 0; n < inputs.size(); ++n) {
    inputs[n].names = {.name = short_name(namings[n].name, 1, kLongestOfInputs),
                       .file = plain(places[n].stem.string())};
    if (!is_in_folder(inputs[n].files.front())) continue;
    const fs::path below = without_folder(places[n].folder, *common);
    inputs[n].names.folder = printable_path(below.empty() ? places[n].folder.filename() : below);
  }
}

// Rejects in advance what would fail after the uploads.
void expect_folders(const std::vector<Input>& inputs, const std::vector<Output>& outputs) {
  const bool are_needed = std::ranges::any_of(
      outputs, [](const Output& output) { return has_folder(output.path.string()); });
  for (const Input& input : inputs) {
    if (!are_needed || !input.names.folder.empty()) continue;
    wrong_usage("-o: " + input.files.front().string() +
                " is in no folder that {folder} could stand for");
  }
}

std::string filled_path(const std::string& path, const OutputNames& names) {
  const std::string& name = has_folder(path) ? names.file : names.name;
  std::string result;
  for (std::string_view rest = path; !rest.empty();) {
    if (rest.starts_with(kName)) {
      result += plain(name);
      rest.remove_prefix(kName.size());
    } else if (rest.starts_with(kFolder)) {
      const bool is_whole = result.empty() || result.ends_with('/');
      rest.remove_prefix(kFolder.size());
      result += is_whole && rest.starts_with('/') ? names.folder : short_name(names.folder, 1);
    } else {
      result += rest.front();
      rest.remove_prefix(1);
    }
  }
  return result;
}

// Empty if a file cannot be looked at; the upload tells it.
std::optional<fs::file_time_type> newest_of(const Input& input) {
  std::optional<fs::file_time_type> newest = fs::file_time_type::min();
  for (const fs::path& path : input.files) {
    if (path == "-") return std::nullopt;
    if (is_stored_volume(path)) continue;
    try {
      for (const PackedFile& file : files_of_upload(path)) {
        newest = std::max(*newest, fs::last_write_time(file.path));
      }
    } catch (const std::exception&) {
      return std::nullopt;
    }
  }
  return newest;
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
  std::vector<Place> places;
  places.reserve(members.size());
  for (const fs::path member : members) {
    places.push_back(
        {member.parent_path(), member.filename(), without_suffixes(member.filename())});
  }
  const std::vector<Naming> namings = namings_of(places, input + '-', kLongest);
  std::vector<std::string> names;
  std::set<std::string> given;
  for (const Naming& naming : namings) {
    if (naming.is_unique) given.insert(short_name(naming.name, 1));
  }
  for (const Naming& naming : namings) {
    names.push_back(short_name(naming.name, 1));
    for (int count = 1; !naming.is_unique && !given.insert(names.back()).second; ++count) {
      names.back() = short_name(naming.name, count);
    }
  }
  return names;
}

std::vector<OutputNames> names_of_members(const OutputNames& input,
                                          const std::vector<std::string>& members) {
  const std::vector<std::string> names = names_of_members(input.name, members);
  const std::vector<std::string> files = names_of_members(input.file, members);
  std::vector<OutputNames> all;
  for (std::size_t n = 0; n < members.size(); ++n) {
    all.push_back({.name = names[n], .file = files[n], .folder = input.folder});
  }
  return all;
}

std::vector<Input> inputs_of(const Options& options) {
  const auto& files = options.files;
  if (!is_by_name(options.outputs)) return {{files, {name_of_input(files.front())}}};
  std::vector<std::vector<fs::path>> sent;
  sent.reserve(files.size());
  for (const fs::path& file : files) sent.push_back(sent_for(file));
  std::vector<Input> inputs;
  for (std::size_t n = 0; n < files.size(); ++n) {
    if (!belongs_to_another(sent, n)) inputs.push_back({{files[n]}, {}});
  }
  give_names(inputs);
  expect_folders(inputs, options.outputs);
  return inputs;
}

bool is_by_name(const std::vector<Output>& outputs) {
  return std::ranges::any_of(outputs, [](const Output& output) {
    return first_placeholder(output.path) != std::string::npos;
  });
}

bool has_folder(const std::string& path) { return path.find(kFolder) != std::string::npos; }

std::size_t first_placeholder(const std::string& path) {
  return std::min(path.find(kName), path.find(kFolder));
}

std::vector<Output> filled(const std::vector<Output>& outputs, const OutputNames& names) {
  std::vector<Output> result = outputs;
  for (Output& output : result) output.path = filled_path(output.path.string(), names);
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

bool is_up_to_date(const Input& input, const std::vector<fs::path>& files) {
  const std::optional<fs::file_time_type> newest = newest_of(input);
  return newest && !files.empty() && std::ranges::all_of(files, [&](const fs::path& file) {
           std::error_code absent;
           return fs::is_regular_file(file, absent) && fs::last_write_time(file, absent) > *newest;
         });
}

}  // namespace isomesh::cli
