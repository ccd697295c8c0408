#pragma once

#include <string_view>
#include <vector>

#include "proto/types.h"

namespace isomesh::import {

// Turns origin and spacing from a header's unit ("mm", "um", "cm", "m", ... or their full names)
// into millimetres; no unit is millimetres, and so is, with a note, one that counts samples
// ("pixel"). Throws Error kUnusableVolume for an unknown one.
void scale_to_millimetres(Geometry& geometry, std::string_view unit, std::vector<Note>& notes);

}  // namespace isomesh::import
