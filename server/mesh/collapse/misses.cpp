#include "server/mesh/collapse/misses.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>

#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

constexpr double kSmallest = 1e-3;  // of the distance: the radius of a piece that is not cut
// More than what double precision loses, of distances from needles too: a share of the distance,
// and of the surface's extent, as far as that is of parts of bodies.
constexpr double kRounding = 1e-6;
constexpr double kMostRoundingMm = 1e-7;
constexpr int kMostCuts = 80;            // on the way to a piece
constexpr double kLeastSide = 1e-3;      // of a piece's radius: what a cut leaves on each side
constexpr std::size_t kManyCorners = 8;  // of a piece: it is cut in its middle
constexpr std::size_t kMostCorners = 16;

std::uint32_t key_of(const WallSides& sides) {
  return std::uint32_t{sides.front} << 16 | sides.back;
}

Point centre_of(const Corners& triangle) {
  const auto& [a, b, c] = triangle;
  return {(a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3, (a[2] + b[2] + c[2]) / 3};
}

struct Plane {
  Point normal = {0, 0, 0};  // a unit vector
  double offset = 0;

  double height_of(const Point& place) const { return dot(normal, place) - offset; }
};

Plane plane_at(const Point& place, const Point& direction) {
  const double length = std::sqrt(dot(direction, direction));
  if (!(length > 0)) return {};
  const Point normal = {direction[0] / length, direction[1] / length, direction[2] / length};
  return {normal, dot(normal, place)};
}

// A convex polygon: a part of a triangle. One of kMostCorners may have lost some.
struct Piece {
  std::array<Point, kMostCorners> corners;
  std::size_t size = 0;

  explicit Piece(std::span<const Point> its_corners) {
    for (const Point& corner : its_corners) add(corner);
  }
  Piece() = default;

  void add(const Point& corner) {
    if (size < kMostCorners) corners[size++] = corner;
  }
  std::span<const Point> span() const { return std::span(corners).first(size); }

  Point centre() const {
    Point sum = {0, 0, 0};
    for (const Point& corner : span()) sum = plus(sum, corner);
    const auto count = static_cast<double>(size);
    return {sum[0] / count, sum[1] / count, sum[2] / count};
  }
};

// The parts below and above a plane.
std::array<Piece, 2> cut(const Piece& piece, const Plane& plane) {
  std::array<Piece, 2> parts;
  for (std::size_t i = 0; i < piece.size; ++i) {
    const Point& from = piece.corners[i];
    const Point& to = piece.corners[i + 1 < piece.size ? i + 1 : 0];
    const double begin = plane.height_of(from);
    const double end = plane.height_of(to);
    if (begin <= 0) parts[0].add(from);
    if (begin >= 0) parts[1].add(from);
    if (!(begin < 0 && end > 0) && !(begin > 0 && end < 0)) continue;
    const double share = begin / (begin - end);
    const Point way = minus(to, from);
    const Point at = plus(from, {way[0] * share, way[1] * share, way[2] * share});
    for (Piece& part : parts) part.add(at);
  }
  return parts;
}

// The distance that double precision can tell to be within the given one; 0 if it can tell none.
double surely_within(double within_mm, const SurfaceView& surface) {
  Reach reach;
  for (const Vec3& position : surface.positions) reach.add({position, position});
  double extent = 0;
  for (std::size_t axis = 0; axis < 3 && !reach.is_empty(); ++axis) {
    extent = std::max(extent, double{reach.high[axis]} - reach.low[axis]);
  }
  const double rounding_mm = std::min(kMostRoundingMm, kRounding * extent);
  return std::max(0.0, within_mm * (1 - kRounding) - rounding_mm);
}

// Looks at one triangle after the other. Not thread safe.
class Searcher {
 public:
  // `within_mm`: as surely_within() gives it.
  Searcher(const WalledSurface& from, const WallGrids& to, double within_mm)
      : from_(from),
        to_(to),
        within_(within_mm),
        squared_within_(within_ * within_),
        guesses_(to.walls(), TriangleGrid::kNone) {}

  std::optional<Miss> look_at(std::uint32_t triangle) {
    const Corners corners = corners_of(from_.view, triangle);
    const std::size_t wall = to_.find(from_.sides_of(triangle));
    if (wall == WallGrids::kNone) {
      return Miss{triangle, centre_of(corners)};
    }
    grid_ = &to_.grid(wall);
    guess_ = guesses_[wall];
    farthest_mm_ = 0;
    const bool is_all_near = is_near(Piece(corners), 0);
    guesses_[wall] = guess_;
    if (is_all_near) return {};
    return Miss{triangle, place_};
  }

 private:
  // Pieces that are too far may be many; the first tells enough.
  bool is_near(const Piece& piece, int cuts) {
    if (piece.size == kMostCorners) return false;
    if (guess_ != TriangleGrid::kNone && is_near_guess(piece)) return true;
    const Point centre = piece.centre();
    const TriangleGrid::Nearest nearest = grid_->nearest(centre, guess_);
    guess_ = nearest.triangle;
    const double distance = std::sqrt(nearest.squared_mm);
    Point longest = {0, 0, 0};
    for (const Point& corner : piece.span()) {
      const Point way = minus(corner, centre);
      if (dot(way, way) > dot(longest, longest)) longest = way;
    }
    const double radius = std::sqrt(dot(longest, longest));
    if (distance + radius <= within_ || is_near_guess(piece)) return true;
    if (distance >= farthest_mm_) {
      farthest_mm_ = distance;
      place_ = centre;
    }
    if (!(distance <= within_) || radius < kSmallest * within_ || cuts == kMostCuts) return false;
    Plane plane = plane_beside_guess(piece, kLeastSide * radius);
    if (plane.normal == Point{0, 0, 0} || piece.size >= kManyCorners) {
      plane = plane_at(centre, longest);
    }
    const auto [below, above] = cut(piece, plane);
    return is_near(below, cuts + 1) && is_near(above, cuts + 1);
  }

  bool is_near_guess(const Piece& piece) const {
    const Corners other = corners_of(grid_->surface(), guess_);
    return std::ranges::all_of(piece.span(), [&](const Point& corner) {
      return squared_distance(corner, other) <= squared_within_;
    });
  }

  // A plane through an edge of the guess, upright on it: with what is above it, the piece reaches
  // farthest beyond the guess. None if all are below, or hardly anything is on one side.
  Plane plane_beside_guess(const Piece& piece, double least) const {
    const Corners guess = corners_of(grid_->surface(), guess_);
    const Point normal = normal_of(guess[0], guess[1], guess[2]);
    Plane best;
    double farthest = least;
    for (std::size_t i = 0; i < 3; ++i) {
      const Plane plane = plane_at(guess[i], cross(minus(guess[(i + 1) % 3], guess[i]), normal));
      double low = 0;
      double high = 0;
      for (const Point& corner : piece.span()) {
        const double height = plane.height_of(corner);
        low = std::min(low, height);
        high = std::max(high, height);
      }
      if (low > -least || high <= farthest) continue;
      farthest = high;
      best = plane;
    }
    return best;
  }

  const WalledSurface& from_;
  const WallGrids& to_;
  const double within_;
  const double squared_within_;
  std::vector<std::uint32_t> guesses_;  // by wall: what was near last
  const TriangleGrid* grid_ = nullptr;
  std::uint32_t guess_ = TriangleGrid::kNone;
  double farthest_mm_ = 0;
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
  const double within = surely_within(within_mm, from.view);
  const auto look = [&](std::size_t begin, std::size_t end) {
    Searcher searcher(from, to, within);
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
