// The options of a job's parameters, generated from their table (proto/parameters.h); private to
// this folder.
#pragma once

#include <string>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "proto/types.h"

namespace isomesh::cli {

// Commands that write files take the formats from -o instead of an option of their own.
enum class Formats { kAsOption, kByFiles };

// How the parameters are sent: a query carries only those with `in_query`.
enum class Carrier { kBody, kQuery };

// Adds an option for each parameter, which sets its member of `parameters`. The name of a preset,
// given instead of an iso-value, goes to `preset`.
void add_parameters(CLI::App& app, JobParameters& parameters, std::string& preset, Formats formats,
                    Carrier carrier = Carrier::kBody);

// The error's text with the options' names instead of the fields': "--max-error" for
// "max_error_mm".
std::string in_options(const Error& error);

}  // namespace isomesh::cli
