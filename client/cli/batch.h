// Several inputs, each with a mesh of its own; private to this folder.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "client/cli/options.h"

namespace isomesh::cli {

// The names of an input's outputs.
struct OutputNames {
  std::string name;         // differs from those of the other inputs
  std::string file = name;  // the file's own, which others may share
  std::string folder = {};  // "sub-01/anat"; empty if the input is in none

  bool operator==(const OutputNames&) const = default;
};

// Files that are sent together, or the id of a stored volume.
struct Input {
  std::vector<std::filesystem::path> files;
  OutputNames names;

  bool operator==(const Input&) const = default;
};

// "head" for "scans/head.nii.gz", "stdin" for "-"; for a folder its own name. As in filled().
std::string name_of_input(const std::filesystem::path& path);

// The names of the outputs of an input's members, for example "study-ct" for "a/ct.nrrd"; all are
// different. Members whose files share that name have the folders in which they differ in it, and,
// if that is not enough, their suffixes. Long names are cut, and numbered if necessary.
std::vector<std::string> names_of_members(const std::string& input,
                                          const std::vector<std::string>& members);
// The same for both names of the input.
std::vector<OutputNames> names_of_members(const OutputNames& input,
                                          const std::vector<std::string>& members);

// If outputs are named after inputs, each file is one input, without those that belong to another
// file, such as the data of a header. Otherwise all files are one input. Inputs are named as
// members are, but without numbers. Throws EarlyExit if an input has no folder for "{folder}".
std::vector<Input> inputs_of(const Options& options);

// True if outputs are named after inputs: one of them has "{name}" or "{folder}" in it.
bool is_by_name(const std::vector<Output>& outputs);

// True if the path has "{folder}" in it.
bool has_folder(const std::string& path);
// The place in the path where its first placeholder begins; npos if there is none.
std::size_t first_placeholder(const std::string& path);

// Replaces "{name}" and "{folder}". In a path with "{folder}", "{name}" is the file's own name. A
// "{folder}" between slashes is a path; otherwise slashes become underscores. Control characters
// become U+FFFD.
std::vector<Output> filled(const std::vector<Output>& outputs, const OutputNames& names);

// The formats of the outputs, each once, in the order of the outputs.
std::vector<MeshFormat> formats_of(const std::vector<Output>& outputs);

// True if every file of the outputs is there and newer than all files of the input. A stored volume
// never changes, and standard input has no time.
bool is_up_to_date(const Input& input, const std::vector<std::filesystem::path>& files);

}  // namespace isomesh::cli
