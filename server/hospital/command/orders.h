#pragma once

#include "client/cli/added.h"

namespace isomesh::cli {

// The commands for orders: place one and wait for its end; show, cancel or retry one, or list all;
// and list the PACS.
Added order_commands();

}  // namespace isomesh::cli
