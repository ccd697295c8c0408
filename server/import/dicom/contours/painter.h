// Contours of one structure -> the samples of slices.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "server/import/dicom/contours/contour_grid.h"
#include "server/import/dicom/contours/raster.h"
#include "server/import/dicom/contours/structure_set.h"

namespace isomesh::import::dicom {

// Samples of a slice within a rectangle; all others are outside.
struct Patch {
  std::uint32_t left = 0;
  std::uint32_t top = 0;
  Mask mask{0, 0};
};

// Draws one structure on a grid. In a slice with contours, their inside by the even-odd rule; each
// contour counts once, though some files repeat it. Between two planes of contours, the shape
// interpolated by signed distances, unless they are more than kMostGaps usual distances apart: then
// they are ends of separate parts. Beyond an end, the end's shape for half a usual distance, so
// that a plane is as thick as the distance: of two slices that are just as far, it has the first.
// The usual distance is the median one of the structure, or of the whole set for a single plane.
//
// Not thread safe.
class Painter {
 public:
  static constexpr double kMostGaps = 3.5;

  // `set_distance` is in slices. Releases the structure's points.
  Painter(Structure& structure, const ContourGrid& grid, double set_distance);

  // Empty if the structure is not in the slice. Throws Error kUnusableVolume if the contours are
  // too long to be drawn.
  std::optional<Patch> slice(std::uint32_t number);

  // Contours that are not parallel to the slices; they are not drawn.
  std::size_t tilted() const { return tilted_; }
  // Slices that were interpolated since the start.
  std::size_t interpolated() const { return interpolated_; }
  // True if both ends lie on slices, of which only the first is drawn: then the structure is half a
  // slice nearer to the first slice.
  bool is_shifted() const;
  // True if the grid ends before the structure does, so that samples of it are missing.
  bool is_cut() const { return is_cut_; }
  // True if no contour lies within the grid.
  bool is_outside() const { return planes_.empty() || width_ == 0 || height_ == 0; }

 private:
  struct Plane {
    double place = 0;  // in slices
    std::vector<std::vector<PlanePoint>> contours;
  };
  struct Distances {
    std::size_t plane = 0;
    std::vector<float> values;
  };

  void place(Structure& structure, const ContourGrid& grid);
  void find_rectangle(const ContourGrid& grid);
  Patch patch(Mask mask) const { return {left_, top_, std::move(mask)}; }
  Mask draw(std::size_t plane);
  const std::vector<float>& distances(std::size_t plane);

  std::array<double, 2> spacing_;
  std::vector<Plane> planes_;  // ascending
  double usual_;
  std::uint32_t left_ = 0;
  std::uint32_t top_ = 0;
  std::uint32_t width_ = 0;
  std::uint32_t height_ = 0;
  bool is_cut_ = false;
  std::array<std::optional<Distances>, 2> cached_;  // of planes with even and odd indices
  std::size_t tilted_ = 0;
  std::size_t interpolated_ = 0;
  std::uint64_t crossed_ = 0;
};

}  // namespace isomesh::import::dicom
