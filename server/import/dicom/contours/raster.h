// Planar contours -> samples of a slice; shapes between two slices.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace isomesh::import::dicom {

// A point in a slice: the column and the row, as real numbers; samples are at whole numbers.
using PlanePoint = std::array<double, 2>;

// The samples of a slice, row by row, 0 or 1.
struct Mask {
  std::uint32_t columns = 0;
  std::uint32_t rows = 0;
  std::vector<std::uint8_t> samples;

  Mask(std::uint32_t of_columns, std::uint32_t of_rows)
      : columns(of_columns), rows(of_rows), samples(std::size_t{of_columns} * of_rows) {}
};

// Draws closed contours by the even-odd rule: a sample is inside if a ray from it crosses the
// contours an odd number of times. So a contour within another one is a hole, and the two sides of
// a channel to a hole (a keyhole) cancel each other exactly. A sample on a contour belongs to the
// side of higher columns and rows. Not thread safe.
class EvenOddRaster {
 public:
  EvenOddRaster(std::uint32_t columns, std::uint32_t rows) : mask_(columns, rows) {}

  // Adds a contour, which is closed from its last point to its first. Coordinates are finite.
  // Parts outside the slice are clipped. Time is proportional to the points and to the rows that
  // the edges cross; returns the number of the latter.
  std::uint64_t add(std::span<const PlanePoint> points);

  // The samples inside. Resets the raster.
  Mask take();

 private:
  std::uint64_t add_edge(const PlanePoint& from, const PlanePoint& to);

  Mask mask_;  // until it is taken: where the parity changes along a row
};

// The distance of each sample from the nearest sample of the other kind, positive inside. Samples
// beyond the slice count as outside. `spacing` is in mm, along rows and along columns. Exact
// (Felzenszwalb and Huttenlocher, Distance Transforms of Sampled Functions, 2012), in single
// precision. A mask without inside samples has distances below any other.
std::vector<float> signed_distances(const Mask& mask, const std::array<double, 2>& spacing);

// The shape at the share `along` (0 to 1) of the way from one slice to the next: where the
// interpolated signed distance is positive (Raya and Udupa, Shape-based interpolation, 1990).
Mask between(const std::vector<float>& from, const std::vector<float>& to, double along,
             std::uint32_t columns, std::uint32_t rows);

}  // namespace isomesh::import::dicom
