// The options for the files of meshes: -o and --format. Private to this folder.
#pragma once

#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "client/cli/options.h"

namespace isomesh::cli {

// The values of the options as they were given.
struct GivenOutputs {
  std::vector<std::string> paths = {};
  std::vector<MeshFormat> formats = {};  // of --format
};

void add_outputs(CLI::App& app, GivenOutputs& given);

// The files to write: those that -o names, and one of each format in a folder. Throws EarlyExit for
// unknown suffixes, missing folders and formats that no output uses.
std::vector<Output> outputs_from(const GivenOutputs& given);

}  // namespace isomesh::cli
