#include "server/import/dicom/contours/painter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "server/import/dicom/geometry/placement.h"
#include "server/import/dicom/geometry/vectors.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

// Limits the rows that all edges of a structure cross: minutes of work, far more than a person
// draws.
constexpr std::uint64_t kMostCrossings = std::uint64_t{1} << 34;

// Positions in the patient's space -> indices of samples, as real numbers.
class IndexSpace {
 public:
  explicit IndexSpace(const Geometry& geometry) : origin_(geometry.origin) {
    const std::array<Vector3, 3> steps = {step_of(geometry, 0), step_of(geometry, 1),
                                          step_of(geometry, 2)};
    const double volume = dot(steps[0], cross(steps[1], steps[2]));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      rows_[axis] = cross(steps[(axis + 1) % 3], steps[(axis + 2) % 3]);
      for (double& part : rows_[axis]) part /= volume;
    }
  }

  Vector3 index(const Vector3& position) const {
    const Vector3 off = difference(position, origin_);
    return {dot(rows_[0], off), dot(rows_[1], off), dot(rows_[2], off)};
  }

 private:
  Vector3 origin_;
  std::array<Vector3, 3> rows_;
};

// The slice of a contour, by the middle of its points; empty if it is tilted.
std::optional<double> place_of(const std::vector<Vector3>& indices, double spacing) {
  const auto [low, high] =
      std::ranges::minmax(indices, {}, [](const Vector3& index) { return index[2]; });
  constexpr double kFlat = 0.2;  // slices
  constexpr double kFlatMm = 0.1;
  const double extent = high[2] - low[2];
  if (!(extent <= std::max(kFlat, kFlatMm / spacing))) return std::nullopt;
  const double middle = (low[2] + high[2]) / 2;
  const double nearest = std::round(middle);
  return std::abs(middle - nearest) <= kSameSlice ? nearest : middle;
}

void remove_doubles(std::vector<std::vector<PlanePoint>>& contours) {
  std::ranges::sort(contours);
  contours.erase(std::unique(contours.begin(), contours.end()), contours.end());
}

}  // namespace

Painter::Painter(Structure& structure, const ContourGrid& grid, double set_distance)
    : spacing_{grid.geometry.spacing[0], grid.geometry.spacing[1]} {
  place(structure, grid);
  std::vector<double> places;
  for (const Plane& plane : planes_) places.push_back(plane.place);
  usual_ = usual_gap(places).value_or(set_distance);
  find_rectangle(grid);
}

void Painter::place(Structure& structure, const ContourGrid& grid) {
  const IndexSpace space(grid.geometry);
  std::vector<Plane> contours;  // one contour each
  for (std::vector<Vector3>& points : structure.contours) {
    for (Vector3& point : points) point = space.index(point);
    if (const auto place = place_of(points, grid.geometry.spacing[2])) {
      std::vector<PlanePoint> flat;
      flat.reserve(points.size());
      for (const Vector3& index : points) flat.push_back({index[0], index[1]});
      contours.push_back({*place, {std::move(flat)}});
    } else {
      ++tilted_;
    }
    std::vector<Vector3>().swap(points);
  }
  std::ranges::stable_sort(contours, {}, &Plane::place);
  for (Plane& contour : contours) {
    if (planes_.empty() || contour.place - planes_.back().place > kSameSlice) {
      planes_.push_back(std::move(contour));
    } else {
      planes_.back().contours.push_back(std::move(contour.contours.front()));
    }
  }
  for (Plane& plane : planes_) remove_doubles(plane.contours);
}

void Painter::find_rectangle(const ContourGrid& grid) {
  std::array<double, 2> low = {static_cast<double>(grid.dims[0]),
                               static_cast<double>(grid.dims[1])};
  std::array<double, 2> high = {-1, -1};
  for (const Plane& plane : planes_) {
    for (const auto& contour : plane.contours) {
      for (const PlanePoint& point : contour) {
        for (std::size_t axis = 0; axis < 2; ++axis) {
          low[axis] = std::min(low[axis], point[axis]);
          high[axis] = std::max(high[axis], point[axis]);
        }
      }
    }
  }
  const auto size = [&](std::size_t axis, std::uint32_t& first) -> std::uint32_t {
    const auto samples = static_cast<double>(grid.dims[axis]);
    // A sample on a contour belongs to the side of the higher ones (raster.h).
    if (low[axis] <= -1 || high[axis] > samples) is_cut_ = true;
    const double begin = std::max(std::floor(low[axis]), 0.0);
    const double end = std::min(std::ceil(high[axis]) + 1, samples);
    if (!(begin < end)) return 0;
    first = static_cast<std::uint32_t>(begin);
    return static_cast<std::uint32_t>(end) - first;
  };
  width_ = size(0, left_);
  height_ = size(1, top_);
  if (planes_.empty()) return;
  // slice() draws by the same rule. It would draw in the two slices next to the grid.
  const double half = usual_ / 2;
  if (planes_.front().place + 1 <= half + kPlaceTolerance) is_cut_ = true;
  if (grid.dims[2] - planes_.back().place < half - kPlaceTolerance) is_cut_ = true;
}

bool Painter::is_shifted() const {
  if (is_outside()) return false;
  return std::ranges::all_of(
      std::array{planes_.front().place - usual_ / 2, planes_.back().place + usual_ / 2},
      [](double end) { return std::abs(end - std::round(end)) <= kPlaceTolerance; });
}

std::optional<Patch> Painter::slice(std::uint32_t number) {
  if (is_outside()) return std::nullopt;
  const double place = number;
  const auto after = std::ranges::lower_bound(planes_, place, {}, &Plane::place);
  const auto above = static_cast<std::size_t>(after - planes_.begin());
  constexpr double kFar = std::numeric_limits<double>::infinity();
  const double up = above < planes_.size() ? planes_[above].place - place : kFar;
  const double down = above > 0 ? place - planes_[above - 1].place : kFar;
  if (up == 0) return patch(draw(above));
  if (up + down <= kMostGaps * usual_) {
    ++interpolated_;
    const std::vector<float>& from = distances(above - 1);
    return patch(between(from, distances(above), down / (up + down), width_, height_));
  }
  // The slice at one end of a plane's thickness belongs to it, and the one at the other end does
  // not. Rounded positions may not change that.
  const double half = usual_ / 2;
  if (up <= half + kPlaceTolerance) return patch(draw(above));
  if (down < half - kPlaceTolerance) return patch(draw(above - 1));
  return std::nullopt;
}

Mask Painter::draw(std::size_t plane) {
  EvenOddRaster raster(width_, height_);
  std::vector<PlanePoint> moved;
  for (const auto& contour : planes_[plane].contours) {
    moved.clear();
    for (const PlanePoint& point : contour) moved.push_back({point[0] - left_, point[1] - top_});
    crossed_ += raster.add(moved) + contour.size();
    if (crossed_ > kMostCrossings) {
      throw_unusable("The contours of the DICOM structure set are too long to be drawn.");
    }
  }
  return raster.take();
}

const std::vector<float>& Painter::distances(std::size_t plane) {
  std::optional<Distances>& cached = cached_[plane % 2];
  if (!cached || cached->plane != plane) {
    cached.reset();
    cached = Distances{plane, signed_distances(draw(plane), spacing_)};
  }
  return cached->values;
}

}  // namespace isomesh::import::dicom
