// Computes and validates geometries, and sizes from headers and requests.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "proto/error.h"
#include "proto/types.h"

namespace isomesh::volume {

using Vector3 = std::array<double, 3>;

// "i", "j" or "k", or "4", "5", ... beyond.
std::string axis_name(std::size_t axis);

// The geometry with sample (0,0,0) at `origin` and the given steps between neighbouring samples
// along i, j and k, all in LPS millimetres. find_fault rejects the result for steps that are zero
// or not finite.
Geometry geometry_of(const Vector3& origin, const std::array<Vector3, 3>& steps);

// The axis's column of `direction`, times its spacing.
Vector3 step_of(const Geometry& geometry, int axis);

// The same lattice with unit direction vectors: the lengths of columns that deviate from 1 by more
// than 1e-3 move to the spacing; all others stay exact. No number is -0.
Geometry normalised(const Geometry& geometry);

// The present axes, from 1 to 3, whose directions the axes i, j and k get; a negative number stands
// for the opposite direction. Each axis occurs once.
using AxisOrder = std::array<int, 3>;
inline constexpr AxisOrder kFilesOrder = {1, 2, 3};  // changes nothing

// The order that has the effect of one, and then another.
AxisOrder in_turn(const AxisOrder& first, const AxisOrder& second);

// Axes as text: "-x,y,z". parse_axis_order returns nothing for any other text.
std::optional<AxisOrder> parse_axis_order(std::string_view text);
std::string to_string(const AxisOrder& order);

// The lattice flipped or turned about its centre; samples and spacings stay with their axes. Throws
// Error kUnusableVolume if an axis gets the direction of another one and they are not
// perpendicular: distances in the volume would change.
Geometry reoriented(const std::array<std::uint32_t, 3>& dims, const Geometry& geometry,
                    const AxisOrder& order);

// The canonical order of axes: index i increases towards the left of the patient, j towards the
// back, k towards the head, as nearly as the directions allow. It is the right-handed order with
// the largest sum of the cosines between i and L, j and P, k and S. Among sums within 1e-4 of it,
// the direction matrix decides that is lexicographically greatest, row by row; numbers within 1e-4
// are equal. So it depends on the lattice alone, and not on the order in which a file has its axes.
// Cosines are rounded first, as canonical_geometry rounds them: its result is in this order.
AxisOrder canonical_order(const Geometry& geometry);

// The change of a lattice's directions as `reoriented` takes it, but of the axes of the canonical
// order. `change` is one of the axes of `geometry`, which may have another order.
AxisOrder along_patient(const AxisOrder& change, const Geometry& geometry);

// Three letters for the directions in which i, j and k increase, as nibabel's axis codes: "LPS" for
// axes in the canonical order, "RAS" for the usual NIfTI file.
std::string axis_codes(const Geometry& geometry);

// The sizes along the axes in that order, and the same lattice counted in it: axis a is the present
// axis |order[a]|, reversed if the number is negative.
std::array<std::uint32_t, 3> in_order(const std::array<std::uint32_t, 3>& dims,
                                      const AxisOrder& order);
Geometry in_order(const std::array<std::uint32_t, 3>& dims, const Geometry& geometry,
                  const AxisOrder& order);

// The lattice in the canonical order of axes, with numbers that do not depend on the sample from
// which a file counts, nor on the numbers with which it places the lattice: each file rounds them
// in its own way, often to single precision. A number becomes the nearest of a grid, whose step is
// 1, 2 or 5 times a power of ten:
//   - of a spacing, the largest up to 7.1e-7 of it;
//   - of a cosine, 2e-7;
//   - of a coordinate of the origin, the largest up to 2e-4 of the smallest spacing.
// The first two leave the middle of the lattice where it is. So numbers as people choose them stay
// or are found again, and others are equal unless a border of a grid lies between them. Rounding
// moves the lattice by at most 1.1e-4 of the smallest spacing along each axis of the patient, and a
// sample by at most 5e-7 of its way along the axes from the middle. The result of the result is
// itself. The geometry must be normalised and free of faults (find_fault).
Geometry canonical_geometry(const std::array<std::uint32_t, 3>& dims, const Geometry& geometry);

// Makes sizes and geometry canonical. Returns the order into which the samples must be put, too
// (sample_order.h). The geometry must be as for canonical_geometry.
AxisOrder make_canonical(std::array<std::uint32_t, 3>& dims, Geometry& geometry);

// The first reason why a geometry is unusable, or empty. Reasons are: numbers that are not finite;
// spacings that are not positive; direction columns that are not unit vectors (to 1e-3) or nearly
// coplanar; coordinates so large that single precision, used in meshes, cannot separate
// neighbouring samples. The field is "spacing", "origin" or "direction".
std::optional<FieldError> find_fault(const std::array<std::uint32_t, 3>& dims,
                                     const Geometry& geometry);

struct SizeLimits {
  std::uint64_t max_sample_bytes = std::uint64_t{16} << 30;  // of a volume's samples
};

// The three sizes of a volume, from at most three in a header; missing ones are 1. Throws Error
// kUnusableVolume for a size of 0, or if the number of bytes overflows.
std::array<std::uint32_t, 3> volume_dims(std::span<const std::uint64_t> sizes);

// Throws Error kTooLarge if the canonical samples would exceed the limits. The bytes of
// `sample_count` samples must not overflow.
void check_limits(std::uint64_t sample_count, SampleType type, const SizeLimits& limits);

// Validates a request's description in advance. Throws Error kInvalidParameter if it is not that of
// a volume, kTooLarge beyond the limits.
void check_raw(const RawDescription& description, const SizeLimits& limits);

}  // namespace isomesh::volume
