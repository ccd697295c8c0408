#pragma once

#include <stop_token>

#include "client/cli/options.h"

namespace isomesh::cli {

// Runs the command and returns its exit status (exit_status.h). Results go to standard output;
// progress and errors go to standard error. A stop request ends the command and cancels the job
// that `mesh` waits for.
int run(const Options& options, const std::stop_token& stop);

// The command `mesh` or `local`: from volumes to files of their meshes. Throws Error as Client does
// if there is one input; with several inputs, reports each failure and continues.
int mesh(const Options& options, const std::stop_token& stop);

}  // namespace isomesh::cli
