// Computes and validates geometries.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "proto/error.h"
#include "proto/types.h"

namespace isomesh::volume {

using Vector3 = std::array<double, 3>;

// The geometry with sample (0,0,0) at `origin` and the given steps between neighbouring samples
// along i, j and k, all in LPS millimetres. find_fault rejects the result for steps that are zero
// or not finite.
Geometry geometry_of(const Vector3& origin, const std::array<Vector3, 3>& steps);

// The axis's column of `direction`, times its spacing.
Vector3 step_of(const Geometry& geometry, int axis);

// The same lattice with unit direction vectors: the lengths of columns that deviate from 1 by more
// than 1e-3 move to the spacing; all others stay exact. No number is -0.
Geometry normalised(const Geometry& geometry);

// The first reason why a geometry is unusable, or empty. Reasons are: numbers that are not finite;
// spacings that are not positive; direction columns that are not unit vectors (to 1e-3) or nearly
// coplanar; coordinates so large that single precision, used in meshes, cannot separate
// neighbouring samples. The field is "spacing", "origin" or "direction".
std::optional<FieldError> find_fault(const std::array<std::uint32_t, 3>& dims,
                                     const Geometry& geometry);

}  // namespace isomesh::volume
