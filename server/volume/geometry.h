// Arithmetic with geometries, and the check whether one can be used.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "proto/error.h"
#include "proto/types.h"

namespace isomesh::volume {

using Vector3 = std::array<double, 3>;

// Makes a geometry of the place of the sample (0,0,0) and the steps between neighbouring samples
// along i, j and k, all in LPS millimetres. find_fault refuses what a step of length 0 or one that
// is not finite makes.
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
