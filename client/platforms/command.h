#pragma once

#include "client/cli/added.h"

namespace isomesh::cli {

// The command `tool`: describes `isomesh local` to programs that run containers.
Added platform_commands();

}  // namespace isomesh::cli
