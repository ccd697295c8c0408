// The options of a job's parameters, which follow from their table (proto/parameters.h); private to
// this folder.
#pragma once

#include <string>

#include <CLI/CLI.hpp>

#include "proto/types.h"

namespace isomesh::cli {

// The formats are given otherwise where the mesh is written to files.
enum class Formats { kAsOption, kByFiles };

// Where the parameters go: a query carries those alone that `in_query` says.
enum class Carrier { kBody, kQuery };

// Adds an option for each parameter, which writes to its member of `parameters`; an iso-value that
// is given by the name of a preset to `preset`.
void add_parameters(CLI::App& app, JobParameters& parameters, std::string& preset, Formats formats,
                    Carrier carrier = Carrier::kBody);

}  // namespace isomesh::cli
