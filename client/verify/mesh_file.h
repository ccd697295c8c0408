// Reads a surface from an STL, PLY or GLB file.
#pragma once

#include <string_view>

#include "client/verify/surface.h"

namespace isomesh::verify {

// The triangles in LPS millimetres: of binary or ASCII STL, and of binary PLY and GLB without a
// codec as isomesh writes them. STL and PLY say if they are in RAS; others are taken for LPS.
// Points with equal coordinates become one. Memory is bounded by the bytes, whatever they say.
// Throws Error kInvalidParameter with the reason for bytes that are none of these, that are
// truncated, or that have coordinates that are not finite.
Surface read_surface(std::string_view bytes);

}  // namespace isomesh::verify
