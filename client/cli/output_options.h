// Where meshes go, as -o and --format say it; private to this folder.
#pragma once

#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "client/cli/options.h"

namespace isomesh::cli {

// What was given, before it is known what that means.
struct GivenOutputs {
  std::vector<std::string> paths = {};
  std::vector<MeshFormat> formats = {};  // of --format
};

void add_outputs(CLI::App& app, GivenOutputs& given);

// The files to write: what -o names, and of a folder one of each format. Throws EarlyExit for what
// cannot be: suffixes that are none, folders that are not there, formats that nothing asks for.
std::vector<Output> outputs_from(const GivenOutputs& given);

}  // namespace isomesh::cli
