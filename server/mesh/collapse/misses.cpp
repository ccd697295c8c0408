#include "server/mesh/collapse/misses.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

constexpr double kSmallest = 1e-3;  // of the distance: the radius of a piece that is not cut
constexpr double kRounding = 1e-9;  // more than what double precision loses, as a share

std::uint32_t key_of(const WallSides& sides) {
  return std::uint32_t{sides.front} << 16 | sides.back;
}

Point middle_of(const Point& a, const Point& b) {
  return {(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2};
}

Point centre_of(const Corners& piece) {
  const auto& [a, b, c] = piece;
  return {(a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3, (a[2] + b[2] + c[2]) / 3};
}

double radius_around(const Point& centre, const Corners& piece) {
  double most = 0;
  for (const Point& corner : piece) {
    const Point way = minus(corner, centre);
    most = std::max(most, dot(way, way));
  }
  return std::sqrt(most);
}

// The triangles of an index.
class InGrid {
 public:
  InGrid(const TriangleGrid& grid, std::uint32_t guess) : grid_(grid), guess_(guess) {}

  // Also makes the one that is nearest the current one.
  double distance_from(const Point& place) {
    const TriangleGrid::Nearest nearest = grid_.nearest(place, guess_);
    guess_ = nearest.triangle;
    return std::sqrt(nearest.squared_mm);
  }
  bool has_current() const { return guess_ != TriangleGrid::kNone; }
  Corners current() const { return corners_of(grid_.surface(), guess_); }
  std::uint32_t guess() const { return guess_; }

 private:
  const TriangleGrid& grid_;
  std::uint32_t guess_;
};

// The same of a few triangles.
class InList {
 public:
  explicit InList(std::span<const Corners> triangles) : triangles_(triangles) {}

  double distance_from(const Point& place) {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t t = 0; t < triangles_.size(); ++t) {
      const double squared = squared_distance(place, triangles_[t]);
      if (!(squared < least)) continue;
      least = squared;
      current_ = t;
    }
    return std::sqrt(least);
  }
  bool has_current() const { return !triangles_.empty(); }
  const Corners& current() const { return triangles_[current_]; }

 private:
  const std::span<const Corners> triangles_;
  std::size_t current_ = 0;
};

// Looks at one triangle after the other. Not thread safe.
template <class Triangles>
class Searcher {
 public:
  Searcher(Triangles triangles, double within_mm)
      : triangles_(triangles),
        within_(within_mm * (1 - kRounding)),
        squared_within_(within_ * within_) {}

  // Pieces that are too far may be many; the first tells enough.
  bool is_near(const Corners& piece) {
    if (triangles_.has_current() && is_near_current(piece)) return true;
    const Point centre = centre_of(piece);
    const double distance = triangles_.distance_from(centre);
    const double radius = radius_around(centre, piece);
    if (distance + radius <= within_) return true;
    if (triangles_.has_current() && is_near_current(piece)) return true;
    if (distance > farthest_) {
      farthest_ = distance;
      place_ = centre;
    }
    if (!(distance <= within_) || radius < kSmallest * within_) return false;
    const auto& [a, b, c] = piece;
    const Point ab = middle_of(a, b);
    const Point bc = middle_of(b, c);
    const Point ca = middle_of(c, a);
    return is_near({ab, bc, ca}) && is_near({a, ab, ca}) && is_near({ab, b, bc}) &&
           is_near({ca, bc, c});
  }

  const Triangles& triangles() const { return triangles_; }
  const Point& farthest_place() const { return place_; }

 private:
  bool is_near_current(const Corners& piece) const {
    const Corners other = triangles_.current();
    return std::ranges::all_of(piece, [&](const Point& corner) {
      return squared_distance(corner, other) <= squared_within_;
    });
  }

  Triangles triangles_;
  const double within_;
  const double squared_within_;
  double farthest_ = 0;
  Point place_ = {0, 0, 0};
};

}  // namespace

WallGrids::WallGrids(const WalledSurface& surface, const Context& context)
    : wall_(surface.view.triangles.size()), number_(wall_.size()) {
  std::vector<std::uint32_t> order(surface.view.triangles.size());
  std::iota(order.begin(), order.end(), 0U);
  const auto key = [&](std::uint32_t t) { return key_of(surface.sides_of(t)); };
  if (!surface.sides.empty()) std::ranges::stable_sort(order, {}, key);
  std::vector<std::size_t> begins;
  triangles_.reserve(order.size());
  for (std::size_t n = 0; n < order.size(); ++n) {
    if (n == 0 || key(order[n]) != key(order[n - 1])) {
      begins.push_back(n);
      sides_.push_back(surface.sides_of(order[n]));
    }
    triangles_.push_back(surface.view.triangles[order[n]]);
    wall_[order[n]] = static_cast<std::uint32_t>(sides_.size() - 1);
    number_[order[n]] = static_cast<std::uint32_t>(n - begins.back());
  }
  begins.push_back(order.size());
  for (std::size_t wall = 0; wall < sides_.size(); ++wall) {
    const auto its = std::span(triangles_).subspan(begins[wall], begins[wall + 1] - begins[wall]);
    grids_.emplace_back(SurfaceView(surface.view.positions, its), context);
  }
}

std::size_t WallGrids::find(const WallSides& sides) const {
  const auto found = std::ranges::lower_bound(sides_, key_of(sides), {}, key_of);
  if (found == sides_.end() || *found != sides) return kNone;
  return static_cast<std::size_t>(found - sides_.begin());
}

bool is_within(const Corners& triangle, const TriangleGrid& others, std::uint32_t guess,
               double within_mm) {
  return Searcher(InGrid(others, guess), within_mm).is_near(triangle);
}

bool is_within(const Corners& triangle, std::span<const Corners> others, double within_mm) {
  return Searcher(InList(others), within_mm).is_near(triangle);
}

std::vector<Miss> find_misses(const WalledSurface& from, std::span<const std::uint32_t> which,
                              const WallGrids& to, double within_mm, const Context& context) {
  constexpr std::size_t kPerTask = 2048;
  std::vector<std::vector<Miss>> found(chunks_of(which.size(), kPerTask));
  const auto look = [&](std::size_t begin, std::size_t end) {
    std::vector<std::uint32_t> guesses(to.walls(), TriangleGrid::kNone);  // what was near last
    for (const std::uint32_t t : which.subspan(begin, end - begin)) {
      const Corners corners = corners_of(from.view, t);
      const std::size_t wall = to.find(from.sides_of(t));
      if (wall == WallGrids::kNone) {
        found[begin / kPerTask].push_back({t, centre_of(corners)});
        continue;
      }
      Searcher searcher(InGrid(to.grid(wall), guesses[wall]), within_mm);
      if (!searcher.is_near(corners)) {
        found[begin / kPerTask].push_back({t, searcher.farthest_place()});
      }
      guesses[wall] = searcher.triangles().guess();
    }
  };
  for_chunks(context, which.size(), look, kPerTask);
  std::vector<Miss> misses;
  for (const auto& part : found) misses.insert(misses.end(), part.begin(), part.end());
  return misses;
}

}  // namespace isomesh::mesh
