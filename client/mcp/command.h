#pragma once

#include "client/cli/added.h"

namespace isomesh::cli {

// The command `mcp`: tools for programs with a language model, by the Model Context Protocol
// (revision 2025-06-18) on standard input and output.
Added mcp_commands();

}  // namespace isomesh::cli
