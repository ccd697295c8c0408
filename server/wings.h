#pragma once

#include "server/http/app/wing.h"

namespace isomesh {

// The wing that a build may have. Without it, check() and open() reject every file.
const http::WingEntry& wing_entry();

}  // namespace isomesh
