#include "server/import/dicom/contours/raster.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace isomesh::import::dicom {
namespace {

// The first whole number not below `value`, clamped to 0..most.
std::uint32_t first_whole(double value, std::uint32_t most) {
  return static_cast<std::uint32_t>(std::clamp(std::ceil(value), 0.0, static_cast<double>(most)));
}

}  // namespace

std::uint64_t EvenOddRaster::add(std::span<const PlanePoint> points) {
  std::uint64_t rows = 0;
  for (std::size_t at = 0; at < points.size(); ++at) {
    rows += add_edge(points[at], points[at + 1 < points.size() ? at + 1 : 0]);
  }
  return rows;
}

// The edge changes the parity of all samples behind it, in the rows from its lower end, inclusive,
// to its upper end, exclusive. Both directions of an edge compute the same crossings.
std::uint64_t EvenOddRaster::add_edge(const PlanePoint& from, const PlanePoint& to) {
  const auto& [low, high] = std::minmax(from, to, [](const PlanePoint& a, const PlanePoint& b) {
    return a[1] != b[1] ? a[1] < b[1] : a[0] < b[0];
  });
  const std::uint32_t begin = first_whole(low[1], mask_.rows);
  const std::uint32_t end = first_whole(high[1], mask_.rows);
  const double slope = (high[0] - low[0]) / (high[1] - low[1]);
  for (std::uint32_t row = begin; row < end; ++row) {
    const double column = low[0] + (row - low[1]) * slope;
    const std::uint32_t first = first_whole(column, mask_.columns);
    if (first < mask_.columns) mask_.samples[std::size_t{row} * mask_.columns + first] ^= 1U;
  }
  return end - begin;
}

Mask EvenOddRaster::take() {
  Mask filled = std::exchange(mask_, Mask(mask_.columns, mask_.rows));
  for (std::uint32_t row = 0; row < filled.rows; ++row) {
    std::uint8_t inside = 0;
    for (std::uint32_t column = 0; column < filled.columns; ++column) {
      std::uint8_t& sample = filled.samples[std::size_t{row} * filled.columns + column];
      inside ^= sample;
      sample = inside;
    }
  }
  return filled;
}

}  // namespace isomesh::import::dicom
