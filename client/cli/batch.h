// Several inputs, each of which becomes a mesh of its own; private to this folder.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "client/cli/options.h"

namespace isomesh::cli {

// What is sent together, and what its outputs are called.
struct Input {
  std::vector<std::filesystem::path> files;
  std::string name;

  bool operator==(const Input&) const = default;
};

// "head" of "scans/head.nii.gz"; of a folder its own name, of "-" "stdin".
std::string name_of_input(const std::filesystem::path& path);

// Each file by itself when outputs are called by their inputs, but for those that belong to another
// one of them, such as the data of a header; all of them together otherwise. Throws Error
// kInvalidParameter where two would write the same output.
std::vector<Input> inputs_of(const Options& options);

// Whether outputs are called by their inputs: one of them has "{name}" in it.
bool is_by_name(const std::vector<Output>& outputs);

// With `name` in place of "{name}", as far as it can be a file's.
std::vector<Output> filled(const std::vector<Output>& outputs, const std::string& name);

}  // namespace isomesh::cli
