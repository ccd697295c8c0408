// Positions of slices along their normal, and their lattice.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/import/dicom/geometry/stack.h"

namespace isomesh::import::dicom {

// The largest deviation of a slice from its lattice position, as a fraction of the slice distance.
// Positions are often written with one or two decimals.
inline constexpr double kPlaceTolerance = 0.05;
// Slices within this distance are at one position.
inline constexpr double kSamePlaceMm = 1e-3;

struct Placed {
  Slice slice;
  double along = 0;  // mm

  const Vector3& position() const { return slice.frame->plane.position; }
};

// Ordered by position; slices at one position keep their order.
std::vector<Placed> placed_along_normal(std::span<const Slice> slices);

// The index of the first slice of each position.
std::vector<std::size_t> position_starts(std::span<const Placed> placed);

// The usual (median) difference of ascending numbers; empty for fewer than two.
std::optional<double> usual_gap(const std::vector<double>& ascending);

// Names a slice whose position in the stack is unknown, by its file and frame. Empty for the only
// slice of a single uploaded file.
std::string place_of(const Slice& slice);

std::string in_mm(double value);
std::string count_of(std::size_t count, const std::string& what);

// Compare slices that may share a lattice.
bool same_orientation(const Slice& a, const Slice& b);
bool same_size(const Slice& a, const Slice& b);
bool same_spacing(const Slice& a, const Slice& b);

// Throws Error kUnusableVolume, naming slices, if they differ in size, orientation, spacing,
// modality or photometric interpretation, or if only some of them have a rescale that changes
// values. Slopes and intercepts themselves may differ.
void refuse_mixtures(std::span<const Slice> slices);

// The lattice whose planes are like `first` and `step` apart.
Geometry lattice(const Plane& first, const Vector3& step);

}  // namespace isomesh::import::dicom
