// The options of a job's parameters, which follow from their table (proto/parameters.h); private to
// this folder.
#pragma once

#include <CLI/CLI.hpp>

#include "proto/types.h"

namespace isomesh::cli {

// The formats are given otherwise where the mesh is written to files.
enum class Formats { kAsOption, kByFiles };

// Adds an option for each parameter, which writes to its member of `parameters`.
void add_parameters(CLI::App& app, JobParameters& parameters, Formats formats);

}  // namespace isomesh::cli
