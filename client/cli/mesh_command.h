// `isomesh mesh` and `isomesh local`: from volumes to files of their meshes; private to this
// folder.
#pragma once

#include <stop_token>

#include "client/cli/options.h"

namespace isomesh::cli {

// Returns the exit status. Throws Error as Client does, for one input; of several each has its own
// failure told, and the others go on.
int mesh(const Options& options, const std::stop_token& stop);

}  // namespace isomesh::cli
