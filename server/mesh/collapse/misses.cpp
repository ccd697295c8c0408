#include "server/mesh/collapse/misses.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

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

// Looks at one triangle after the other. Not thread safe.
class Searcher {
 public:
  Searcher(const WalledSurface& from, const WallGrids& to, double within_mm)
      : from_(from),
        to_(to),
        within_(within_mm * (1 - kRounding)),
        squared_within_(within_ * within_),
        guesses_(to.walls(), TriangleGrid::kNone) {}

  std::optional<Miss> look_at(std::uint32_t triangle) {
    const Corners corners = corners_of(from_.view, triangle);
    const std::size_t wall = to_.find(from_.sides_of(triangle));
    if (wall == WallGrids::kNone) return Miss{triangle, centre_of(corners), centre_of(corners)};
    grid_ = &to_.grid(wall);
    guess_ = guesses_[wall];
    farthest_mm_ = 0;
    const bool is_all_near = is_near(corners);
    guesses_[wall] = guess_;
    if (is_all_near) return {};
    return Miss{triangle, place_, centre_of(corners_of(grid_->surface(), nearest_))};
  }

 private:
  // Pieces that are too far may be many; the first tells enough.
  bool is_near(const Corners& piece) {
    if (guess_ != TriangleGrid::kNone && is_near_guess(piece)) return true;
    const Point centre = centre_of(piece);
    const TriangleGrid::Nearest nearest = grid_->nearest(centre, guess_);
    guess_ = nearest.triangle;
    const double distance = std::sqrt(nearest.squared_mm);
    const double radius = radius_around(centre, piece);
    if (distance + radius <= within_ || is_near_guess(piece)) return true;
    if (distance >= farthest_mm_) {
      farthest_mm_ = distance;
      nearest_ = nearest.triangle;
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

  bool is_near_guess(const Corners& piece) const {
    const Corners other = corners_of(grid_->surface(), guess_);
    return std::ranges::all_of(piece, [&](const Point& corner) {
      return squared_distance(corner, other) <= squared_within_;
    });
  }

  const WalledSurface& from_;
  const WallGrids& to_;
  const double within_;
  const double squared_within_;
  std::vector<std::uint32_t> guesses_;  // by wall: what was near last
  const TriangleGrid* grid_ = nullptr;
  std::uint32_t guess_ = TriangleGrid::kNone;
  double farthest_mm_ = 0;
  std::uint32_t nearest_ = 0;  // to the place
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

std::vector<Miss> find_misses(const WalledSurface& from, std::span<const std::uint32_t> which,
                              const WallGrids& to, double within_mm, const Context& context) {
  constexpr std::size_t kPerTask = 2048;
  std::vector<std::vector<Miss>> found(chunks_of(which.size(), kPerTask));
  const auto look = [&](std::size_t begin, std::size_t end) {
    Searcher searcher(from, to, within_mm);
    for (const std::uint32_t t : which.subspan(begin, end - begin)) {
      if (const auto miss = searcher.look_at(t)) found[begin / kPerTask].push_back(*miss);
    }
  };
  for_chunks(context, which.size(), look, kPerTask);
  std::vector<Miss> misses;
  for (const auto& part : found) misses.insert(misses.end(), part.begin(), part.end());
  return misses;
}

}  // namespace isomesh::mesh
