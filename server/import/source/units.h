#pragma once

#include <string_view>
#include <vector>

#include "proto/types.h"

namespace isomesh::import {

// Scales origin and spacing from a header's unit ("mm", "um", "cm", "m", ... or full names) to
// millimetres. A missing unit is millimetres; so is, with a note, one that counts samples
// ("pixel"). Throws Error kUnusableVolume for unknown units.
void scale_to_millimetres(Geometry& geometry, std::string_view unit, std::vector<Note>& notes);

}  // namespace isomesh::import
