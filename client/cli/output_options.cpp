#include <algorithm>
#include <filesystem>

#include <unistd.h>

#include "base/text.h"
#include "client/cli/batch.h"
#include "client/cli/option_groups.h"
#include "client/cli/option_values.h"
#include "proto/parameters.h"

namespace isomesh::cli {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse_output(const std::string& message) { wrong_usage("-o: " + message); }

std::string suffixes() {
  std::vector<std::string> all;
  for (const std::string& name : name_list<MeshFormat>()) all.push_back('.' + name);
  return listed(all);
}

MeshFormat format_of(const fs::path& path) {
  const std::string suffix = lower(path.extension().string());
  const auto format = from_string<MeshFormat>(suffix.empty() ? suffix : suffix.substr(1));
  if (!format) {
    refuse_output(path.string() + " must end in " + suffixes() +
                  ", or be a folder, or - with --format");
  }
  return *format;
}

// `path` is the file to write there.
void check_folder(const fs::path& folder, const std::string& path) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) refuse_output("the folder of " + path + " does not exist");
  if (::access(folder.c_str(), W_OK) != 0) {
    refuse_output("the folder of " + path + " is not writable");
  }
}

// The folder is made before the first mesh is written. So it must be possible.
void check_new_folder(const fs::path& folder) {
  fs::path there = fs::absolute(folder);
  std::error_code error;
  while (!fs::exists(there, error) && there.has_relative_path()) there = there.parent_path();
  if (!fs::is_directory(there, error)) refuse_output(there.string() + " is not a folder");
  if (::access(there.c_str(), W_OK) != 0) {
    refuse_output("the folder " + there.string() + " is not writable");
  }
}

bool is_folder(const std::string& path) {
  std::error_code error;
  return path.ends_with('/') || fs::is_directory(path, error);
}

bool is_standard_output(const std::string& path) { return path == "-" || path == "/dev/stdout"; }

MeshFormat format_of_stream(const std::string& path, const GivenOutputs& given) {
  if (given.formats.size() == 1) return given.formats.front();
  const bool has_suffix = fs::path(path).has_extension();
  if (!has_suffix) refuse_output(path + " needs one --format, such as --format stl");
  return format_of(path);
}

// The file's place: as it was named, without the part that the input's name decides.
void check_place(const std::string& path) {
  const std::string fixed = path.substr(0, first_placeholder(path));
  const fs::path folder = fs::path(fixed).parent_path();
  const bool is_made = fs::path(path).parent_path() != folder;
  const fs::path place = folder.empty() ? "." : folder;
  is_made ? check_new_folder(place) : check_folder(place, path);
}

// "x.glb,y.stl" is a valid file name, but was meant as a list.
void refuse_list(const std::string& path) {
  const auto is_output = [](std::string_view part) {
    const std::string suffix = lower(fs::path(part).extension().string());
    return !suffix.empty() && from_string<MeshFormat>(suffix.substr(1)).has_value();
  };
  const auto parts = split(path, ',');
  if (parts.size() < 2 || !std::ranges::all_of(parts, is_output)) return;
  std::string each;
  for (const std::string_view part : parts) each += " -o " + std::string(part);
  refuse_output(path + " looks like a list; repeat the option instead:" + each);
}

}  // namespace

void add_outputs(CLI::App& app, GivenOutputs& given) {
  add_repeated(app, "-o,--output", "OUT",
               "File to write the mesh to; its suffix chooses the format: " + suffixes() +
                   ". A folder, which is created if it ends in /, or {name} in the file's name, "
                   "gives each FILE a mesh of its own. {folder} stands for the FILE's folder. "
                   "- is standard output",
               [&given](const std::vector<std::string>& paths) { given.paths = paths; });
  add(app, "--format", type_of_names<MeshFormat>() + ",..",
      "Formats of the files in a folder (default: drc), or the format of - or a pipe",
      [&given](const std::string& text) {
        for (const std::string_view name : split(text, ',')) {
          given.formats.push_back(name_from<MeshFormat>("--format", lower(name)));
        }
      });
}

std::vector<Output> outputs_from(const GivenOutputs& given) {
  std::vector<Output> outputs;
  bool is_format_used = false;
  for (const std::string& path : given.paths) {
    if (is_standard_output(path) || is_pipe(path)) {
      outputs.push_back({is_standard_output(path) ? "-" : path, format_of_stream(path, given)});
      is_format_used = true;
    } else if (is_folder(path)) {
      check_new_folder(path);
      for (const MeshFormat format :
           given.formats.empty() ? std::vector{MeshFormat::kDrc} : given.formats) {
        const std::string name = "{name}." + std::string(file_suffix(format));
        outputs.push_back({fs::path(path) / name, format});
      }
      is_format_used = true;
    } else {
      refuse_list(path);
      check_place(path);
      outputs.push_back({path, format_of(path)});
    }
  }
  if (!given.formats.empty() && !is_format_used && !given.paths.empty()) {
    wrong_usage(
        "--format is only for folders, - and pipes; the suffix of a file chooses its format");
  }
  const auto by_name = [](const Output& output) { return is_by_name({output}); };
  if (std::ranges::any_of(outputs, by_name) && !std::ranges::all_of(outputs, by_name)) {
    refuse_output("either all outputs need {name}, {folder} or a folder, or none of them");
  }
  return outputs;
}

}  // namespace isomesh::cli
