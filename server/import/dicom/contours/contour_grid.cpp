#include "server/import/dicom/contours/contour_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "base/text.h"
#include "server/import/dicom/geometry/placement.h"
#include "server/import/dicom/geometry/vectors.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

constexpr double kMostSamplesOfSide = 65535;
// Planes nearer than this are the same, in mm.
constexpr double kSamePlane = 1e-2;

// Twice the area of a closed polygon, as a vector along its normal (Newell).
Vector3 area_of(const std::vector<Vector3>& points) {
  Vector3 area = {};
  const Vector3& base = points.front();
  for (std::size_t at = 1; at + 1 < points.size(); ++at) {
    const Vector3 part = cross(difference(points[at], base), difference(points[at + 1], base));
    for (std::size_t axis = 0; axis < 3; ++axis) area[axis] += part[axis];
  }
  return area;
}

// The unit normal of the largest contour, towards the patient's head, back or left; exactly an axis
// if it is nearly one.
Vector3 normal_of(const StructureSet& set) {
  constexpr double kNearlyOne = 1 - 1e-6;
  Vector3 normal = {0, 0, 1};
  double largest = 0;
  for (const Structure& structure : set.structures) {
    for (const auto& contour : structure.contours) {
      const Vector3 area = area_of(contour);
      const double size = length(area);
      if (!std::isfinite(size) || size <= largest) continue;
      largest = size;
      for (std::size_t axis = 0; axis < 3; ++axis) normal[axis] = area[axis] / size;
    }
  }
  const auto* main =
      std::ranges::max_element(normal, {}, [](double part) { return std::abs(part); });
  if (*main < 0) {
    for (double& part : normal) part = -part;
  }
  if (*main > kNearlyOne) {
    const auto axis = static_cast<std::size_t>(main - normal.begin());
    normal = {};
    normal[axis] = 1;
  }
  return normal;
}

// Rows along the patient's x if the planes allow that, otherwise along y.
std::array<Vector3, 3> axes_of(const StructureSet& set) {
  const Vector3 normal = normal_of(set);
  Vector3 row = std::abs(normal[0]) < 0.9 ? Vector3{1, 0, 0} : Vector3{0, 1, 0};
  row = moved(row, normal, -dot(row, normal));
  const double size = length(row);
  for (double& part : row) part /= size;
  return {row, cross(normal, row), normal};
}

struct Extents {
  std::array<double, 3> low;
  std::array<double, 3> high;
};

Extents extents_of(const StructureSet& set, const std::array<Vector3, 3>& axes) {
  Extents extents;
  extents.low.fill(std::numeric_limits<double>::infinity());
  extents.high.fill(-std::numeric_limits<double>::infinity());
  for (const Structure& structure : set.structures) {
    for (const auto& contour : structure.contours) {
      for (const Vector3& point : contour) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const double place = dot(point, axes[axis]);
          extents.low[axis] = std::min(extents.low[axis], place);
          extents.high[axis] = std::max(extents.high[axis], place);
        }
      }
    }
  }
  return extents;
}

// The places of contours along the third axis of a grid, in slices. Contours that are not parallel
// to the slices have none.
std::vector<double> places_of(const StructureSet& set, const Geometry& grid) {
  constexpr double kFlat = 0.2;
  const Vector3 across = cross(step_of(grid, 0), step_of(grid, 1));
  const double slice = dot(across, step_of(grid, 2));
  const auto place_of = [&](const Vector3& point) {
    return dot(across, difference(point, grid.origin)) / slice;
  };
  std::vector<double> places;
  for (const Structure& structure : set.structures) {
    for (const auto& contour : structure.contours) {
      const auto [low, high] = std::ranges::minmax(contour, {}, place_of);
      const double middle = (place_of(low) + place_of(high)) / 2;
      if (place_of(high) - place_of(low) <= kFlat) places.push_back(middle);
    }
  }
  return places;
}

// The distance of all places from the slices before them, 0..1. Empty if they differ.
std::optional<double> shared_offset(const std::vector<double>& places) {
  if (places.empty()) return std::nullopt;
  const double first = places.front() - std::floor(places.front());
  double sum = 0;
  for (const double place : places) {
    const double off = place - first - std::round(place - first);
    if (!(std::abs(off) <= kSameSlice)) return std::nullopt;
    sum += off;
  }
  const double mean = first + sum / static_cast<double>(places.size());
  return mean - std::floor(mean);
}

}  // namespace

ContourGrid grid_of_images(const StructureSet& set, const ContourGrid& images) {
  const auto offset = shared_offset(places_of(set, images.geometry));
  if (!offset || *offset <= kSameSlice || *offset >= 1 - kSameSlice) return images;
  ContourGrid grid = images;
  grid.geometry.origin = moved(grid.geometry.origin, step_of(grid.geometry, 2), *offset - 1);
  ++grid.dims[2];
  return grid;
}

std::optional<double> usual_distance(const StructureSet& set) {
  const Vector3 normal = normal_of(set);
  std::vector<double> places;
  for (const Structure& structure : set.structures) {
    for (const auto& contour : structure.contours) places.push_back(dot(contour.front(), normal));
  }
  std::ranges::sort(places);
  std::vector<double> planes;
  for (const double place : places) {
    if (planes.empty() || place - planes.back() > kSamePlane) planes.push_back(place);
  }
  return usual_gap(planes);
}

ContourGrid grid_around(const StructureSet& set, const std::array<double, 3>& spacing) {
  const std::array<Vector3, 3> axes = axes_of(set);
  const Extents extents = extents_of(set, axes);
  // The first and last planes stand for half of a distance beyond them.
  const double half = std::ceil(usual_distance(set).value_or(0) / 2 / spacing[2]);
  const std::array<double, 3> margins = {1, 1, 1 + half};
  ContourGrid grid;
  Vector3 origin = {};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double steps = (extents.high[axis] - extents.low[axis]) / spacing[axis];
    // Rounding may not cut the last plane off.
    const double count = std::ceil(steps - 1e-6) + 1 + 2 * margins[axis];
    if (!(count <= kMostSamplesOfSide)) {
      throw_unusable("With a spacing of " + to_text(spacing[axis]) +
                     " mm the contours of the DICOM structure set need more than " +
                     to_text(kMostSamplesOfSide) + " samples along an axis.");
    }
    grid.dims[axis] = static_cast<std::uint32_t>(count);
    origin = moved(origin, axes[axis], extents.low[axis] - margins[axis] * spacing[axis]);
  }
  grid.geometry.origin = origin;
  grid.geometry.spacing = spacing;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      grid.geometry.direction[row * 3 + axis] = axes[axis][row];
    }
  }
  return grid;
}

}  // namespace isomesh::import::dicom
