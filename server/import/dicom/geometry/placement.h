// Slices along their normal, and the lattice that they make.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "server/import/dicom/geometry/stack.h"

namespace isomesh::import::dicom {

// How far a slice may lie off its place, as a share of the distance between slices, because
// positions are often written with one or two decimals.
inline constexpr double kPlaceTolerance = 0.05;
// Slices that are nearer to each other than this are at one position.
inline constexpr double kSamePlace_mm = 1e-3;

// A slice with how far along the normal it lies.
struct Placed {
  Slice slice;
  double along = 0;  // mm

  const Vector3& position() const { return slice.frame->plane.position; }
};

// By their places, those at one in the order in which they come.
std::vector<Placed> placed_along_normal(std::span<const Slice> slices);

// Where among `placed` each position begins.
std::vector<std::size_t> position_starts(std::span<const Placed> placed);

// "2.5 mm"
std::string in_mm(double value);
// "1 slice", "2 slices"
std::string count_of(std::size_t count, const std::string& what);

// True for slices that may lie in one lattice, as far as the name says.
bool same_orientation(const Slice& a, const Slice& b);
bool same_size(const Slice& a, const Slice& b);
bool same_spacing(const Slice& a, const Slice& b);

// What all slices of a lattice have in common: size, orientation, spacing, modality, photometric
// interpretation. Throws Error kUnusableVolume, naming slices, when some differ.
void refuse_mixtures(std::span<const Slice> slices);

// The lattice of planes like `first`, one `step` after another.
Geometry lattice(const Plane& first, const Vector3& step);

}  // namespace isomesh::import::dicom
