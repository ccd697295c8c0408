#include "server/mesh/measure/diameter.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <tuple>
#include <utility>
#include <vector>

#include "base/error.h"
#include "server/mesh/points.h"

namespace isomesh::mesh {
namespace {

constexpr std::size_t kLeafPoints = 32;
// More than the rounding errors of a bound, so that no larger distance is missed.
constexpr double kSlack = 1 + 1e-14;

double squared(double value) { return value * value; }

double squared_distance(const Point& a, const Point& b) {
  const Point between = minus(b, a);
  return dot(between, between);
}

// The point with the largest distance from `from`.
Point farthest(std::span<const Vec3> points, const Point& from) {
  const auto is_nearer = [&](const Vec3& a, const Vec3& b) {
    return squared_distance(to_point(a), from) < squared_distance(to_point(b), from);
  };
  return to_point(*std::ranges::max_element(points, is_nearer));
}

class DiameterSearch {
 public:
  DiameterSearch(std::span<Vec3> points, const std::stop_token& stop) : stop_(stop) {
    const Point one = farthest(points, to_point(points.front()));
    const Point other = farthest(points, one);
    largest_ = squared_distance(one, other);
    points_ = far_enough(points, one, other);
    if (points_.size() < 2) return;
    nodes_.reserve(4 * points_.size() / kLeafPoints + 1);
    const std::uint32_t root = build(0, points_.size());
    compare(root, root);
  }

  double largest() const { return std::sqrt(largest_); }

 private:
  struct Node {
    std::size_t begin = 0;
    std::size_t end = 0;
    Point centre = {};
    double radius = 0;
    std::uint32_t first = 0;  // children; none has the number 0
    std::uint32_t second = 0;
  };

  // The points of a node as seen along a line through its centre.
  struct View {
    double low = std::numeric_limits<double>::infinity();
    double high = -std::numeric_limits<double>::infinity();
    double aside = 0;  // the largest squared distance from the line
    std::size_t lowest = 0;
    std::size_t highest = 0;
  };

  // The points that may be an end of the largest distance, given that of two of them.
  std::span<Vec3> far_enough(std::span<Vec3> points, const Point& one, const Point& other) const {
    const Point middle = {(one[0] + other[0]) / 2, (one[1] + other[1]) / 2,
                          (one[2] + other[2]) / 2};
    const double radius = std::sqrt(squared_distance(farthest(points, middle), middle));
    const auto is_far = [&](const Vec3& point) {
      const double most = std::sqrt(squared_distance(to_point(point), middle)) + radius;
      return squared(most) * kSlack > largest_;
    };
    const auto rest = std::partition(points.begin(), points.end(), is_far);
    return points.first(static_cast<std::size_t>(rest - points.begin()));
  }

  std::uint32_t build(std::size_t begin, std::size_t end) {
    const auto number = static_cast<std::uint32_t>(nodes_.size());
    nodes_.emplace_back();
    Node node = {.begin = begin, .end = end};
    const std::span<Vec3> own = points_.subspan(begin, end - begin);
    Point low = to_point(own.front());
    Point high = low;
    for (const Vec3& point : own) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        low[axis] = std::min<double>(low[axis], point[axis]);
        high[axis] = std::max<double>(high[axis], point[axis]);
      }
    }
    std::size_t widest = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      node.centre[axis] = (low[axis] + high[axis]) / 2;
      if (high[axis] - low[axis] > high[widest] - low[widest]) widest = axis;
    }
    node.radius = std::sqrt(squared_distance(farthest(own, node.centre), node.centre));
    if (own.size() > kLeafPoints && node.radius > 0) {
      const std::size_t half = own.size() / 2;
      std::nth_element(own.begin(), own.begin() + static_cast<std::ptrdiff_t>(half), own.end(),
                       [&](const Vec3& a, const Vec3& b) { return a[widest] < b[widest]; });
      node.first = build(begin, begin + half);
      node.second = build(begin + half, end);
    }
    nodes_[number] = node;
    return number;
  }

  View view(const Node& node, const Point& direction) const {
    View view;
    for (std::size_t n = node.begin; n < node.end; ++n) {
      const Point offset = minus(to_point(points_[n]), node.centre);
      const double along = dot(offset, direction);
      view.aside = std::max(view.aside, dot(offset, offset) - squared(along));
      if (along < view.low) std::tie(view.low, view.lowest) = std::pair(along, n);
      if (along > view.high) std::tie(view.high, view.highest) = std::pair(along, n);
    }
    return view;
  }

  void found(std::size_t a, std::size_t b) {
    largest_ = std::max(largest_, squared_distance(to_point(points_[a]), to_point(points_[b])));
  }

  bool may_be_larger(double squared_bound) const { return squared_bound * kSlack > largest_; }

  // False if the points of `a` and `b` have no larger distance than the largest one found.
  bool may_have_larger(const Node& a, const Node& b) {
    const double between = std::sqrt(squared_distance(a.centre, b.centre));
    if (!may_be_larger(squared(between + a.radius + b.radius))) return false;
    if (between == 0) return true;
    Point direction = minus(b.centre, a.centre);
    for (double& value : direction) value /= between;
    const View from = view(a, direction);
    const View to = view(b, direction);
    found(from.lowest, to.highest);
    const double along = between + to.high - from.low;
    // Rounding may leave a negative square.
    const double across = std::sqrt(std::max(0.0, from.aside)) + std::sqrt(std::max(0.0, to.aside));
    return may_be_larger(squared(along) + squared(across));
  }

  void compare(std::uint32_t one, std::uint32_t other) {
    if (stop_.stop_requested()) throw Error(ErrorCode::kCancelled, "the measurement was stopped");
    const Node a = nodes_[one];
    const Node b = nodes_[other];
    if (one == other) {
      if (!may_be_larger(squared(2 * a.radius))) return;
      if (a.first == 0) return compare_points(a, b);
      compare(a.first, a.second);
      compare(a.first, a.first);
      return compare(a.second, a.second);
    }
    if (!may_have_larger(a, b)) return;
    if (a.first == 0 && b.first == 0) return compare_points(a, b);
    const bool is_a_split = b.first == 0 || (a.first != 0 && a.radius >= b.radius);
    if (is_a_split) {
      compare(a.first, other);
      compare(a.second, other);
    } else {
      compare(one, b.first);
      compare(one, b.second);
    }
  }

  void compare_points(const Node& a, const Node& b) {
    for (std::size_t n = a.begin; n < a.end; ++n) {
      for (std::size_t m = b.begin; m < b.end; ++m) found(n, m);
    }
  }

  const std::stop_token& stop_;
  std::span<Vec3> points_;
  std::vector<Node> nodes_;
  double largest_ = 0;  // squared
};

}  // namespace

double largest_distance(std::span<Vec3> points, const std::stop_token& stop) {
  const auto is_finite = [](const Vec3& point) {
    return std::ranges::all_of(point, [](float value) { return std::isfinite(value); });
  };
  if (!std::ranges::all_of(points, is_finite)) {
    throw Error(ErrorCode::kUnusableVolume, "the surface has a vertex that is not finite");
  }
  return points.size() < 2 ? 0 : DiameterSearch(points, stop).largest();
}

}  // namespace isomesh::mesh
