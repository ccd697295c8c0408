// Whether samples lie where a surface can be made of them.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "proto/error.h"
#include "proto/types.h"

namespace isomesh::volume {

using Vector3 = std::array<double, 3>;

// A geometry from where the sample (0,0,0) lies and the steps from a sample to the next along
// i, j and k, all in LPS millimetres. A step of length 0 or not finite gives one that find_fault
// finds fault with.
Geometry geometry_of(const Vector3& origin, const std::array<Vector3, 3>& steps);

// The column of `direction` that belongs to an axis, times its spacing.
Vector3 step_of(const Geometry& geometry, int axis);

// The same lattice with unit vectors for directions: columns that are longer or shorter (by more
// than 1e-3) give their length to the spacing, all others stay exactly as they are. No number is
// -0.
Geometry normalised(const Geometry& geometry);

// The first thing that makes a geometry unusable, or nothing: numbers that are not finite, spacings
// that are not positive, a direction whose columns are not unit vectors (to 1e-3) or lie nearly in
// one plane, coordinates so far out that single precision, in which meshes are written, cannot tell
// neighbouring samples apart. The field is "spacing", "origin" or "direction".
std::optional<FieldError> find_fault(const std::array<std::uint32_t, 3>& dims,
                                     const Geometry& geometry);

}  // namespace isomesh::volume
