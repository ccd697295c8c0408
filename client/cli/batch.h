// Several inputs, each with a mesh of its own; private to this folder.
#pragma once

#include <filesystem>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "client/cli/options.h"

namespace isomesh::cli {

// Files that are sent together, or the id of a stored volume, and the name of the outputs.
struct Input {
  std::vector<std::filesystem::path> files;
  std::string name;

  bool operator==(const Input&) const = default;
};

// "head" for "scans/head.nii.gz", "stdin" for "-"; for a folder its own name. As in filled().
std::string name_of_input(const std::filesystem::path& path);

// The names of the outputs of an input's members, for example "study-ct" for "a/ct.nrrd"; all are
// different. Members whose files share that name have the folders in which they differ in it, and,
// if that is not enough, their suffixes. Long names are cut, and numbered if necessary.
std::vector<std::string> names_of_members(const std::string& input,
                                          const std::vector<std::string>& members);

// The names of the outputs of one run. Thread safe.
class TakenNames {
 public:
  // False if another output has it.
  bool take(const std::string& name);

 private:
  std::mutex mutex_;
  std::set<std::string> names_;
};

// If outputs are named after inputs, each file is one input, without those that belong to another
// file, such as the data of a header. Otherwise all files are one input. Throws EarlyExit if two
// inputs would write the same output.
std::vector<Input> inputs_of(const Options& options);

// True if outputs are named after inputs: one of them has "{name}" in it.
bool is_by_name(const std::vector<Output>& outputs);

// Replaces "{name}" by `name`; slashes become underscores, and control characters U+FFFD.
std::vector<Output> filled(const std::vector<Output>& outputs, const std::string& name);

// The formats of the outputs, each once, in the order of the outputs.
std::vector<MeshFormat> formats_of(const std::vector<Output>& outputs);

}  // namespace isomesh::cli
