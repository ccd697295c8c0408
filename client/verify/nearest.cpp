#include <algorithm>
#include <array>
#include <numeric>
#include <tuple>
#include <utility>

#include "client/verify/surface.h"

namespace isomesh::verify {
namespace {

constexpr std::uint32_t kLeafTriangles = 4;
constexpr std::size_t kMostDepth = 64;  // halves of at most 2^32 triangles

double squared_to_segment(const Vec& p, const Vec& a, const Vec& b) {
  const Vec way = b - a;
  const double whole = squared(way);
  const double share = whole > 0 ? std::clamp(dot(p - a, way) / whole, 0.0, 1.0) : 0;
  return squared(p - (a + share * way));
}

}  // namespace

double squared_distance(const Vec& p, const Corners& t, double enough) {
  const auto& [a, b, c] = t;
  const Vec n = normal_of(t);
  // The normal of a sliver is noise. Its edges are as near as it is.
  if (squared(n) > 1e-16 * squared(b - a) * squared(c - a)) {
    const double from_plane = dot(p - a, n) * dot(p - a, n) / squared(n);
    if (from_plane > enough ||
        (dot(cross(b - a, p - a), n) >= 0 && dot(cross(c - b, p - b), n) >= 0 &&
         dot(cross(a - c, p - c), n) >= 0)) {
      return from_plane;
    }
  }
  return std::min(
      {squared_to_segment(p, a, b), squared_to_segment(p, b, c), squared_to_segment(p, c, a)});
}

std::vector<std::uint32_t> components_of(const Surface& surface) {
  std::vector<std::uint32_t> parent(surface.points.size());
  std::iota(parent.begin(), parent.end(), 0U);
  const auto root = [&parent](std::uint32_t point) {
    while (parent[point] != point) point = parent[point] = parent[parent[point]];
    return point;
  };
  for (const auto& triangle : surface.triangles) {
    for (const std::uint32_t other : {triangle[1], triangle[2]}) {
      const auto [low, high] = std::minmax({root(triangle[0]), root(other)});
      parent[high] = low;
    }
  }
  for (std::uint32_t point = 0; point < parent.size(); ++point) parent[point] = root(point);
  return parent;
}

Tree::Tree(Surface& surface) : surface_(surface) {
  std::vector<Item> items;
  items.reserve(surface.triangles.size());
  for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
    items.push_back({centre_of(surface.corners(t)), surface.triangles[t]});
  }
  if (!items.empty()) build(items, 0, static_cast<std::uint32_t>(items.size()));
  std::ranges::transform(items, surface.triangles.begin(), &Item::triangle);
}

void Tree::build(std::vector<Item>& items, std::uint32_t begin, std::uint32_t end) {
  Node node = {.first = begin, .count = end - begin};
  for (std::uint32_t at = begin; at < end; ++at) {
    for (const std::uint32_t point : items[at].triangle) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        node.low[axis] = std::min(node.low[axis], surface_.points[point][axis]);
        node.high[axis] = std::max(node.high[axis], surface_.points[point][axis]);
      }
    }
  }
  const std::size_t own = nodes_.size();
  nodes_.push_back(node);
  if (node.count <= kLeafTriangles) return;
  const Vec size = node.high - node.low;
  const auto axis = static_cast<std::size_t>(std::ranges::max_element(size) - size.begin());
  const std::uint32_t middle = begin + node.count / 2;
  std::nth_element(
      items.begin() + begin, items.begin() + middle, items.begin() + end,
      [axis](const Item& a, const Item& b) { return a.centre[axis] < b.centre[axis]; });
  build(items, begin, middle);
  nodes_[own].first = static_cast<std::uint32_t>(nodes_.size());
  nodes_[own].count = 0;
  build(items, middle, end);
}

template <class Takes>
Nearest Tree::nearest_of(const Vec& point, Nearest best, const Takes& takes) const {
  using Waiting = std::pair<double, std::uint32_t>;  // the squared distance to a node's box
  const auto waiting_for = [&](std::uint32_t node) {
    double sum = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double way = std::max(
          {nodes_[node].low[axis] - point[axis], point[axis] - nodes_[node].high[axis], 0.0});
      sum += way * way;
    }
    return Waiting(sum, node);
  };
  std::array<Waiting, kMostDepth> stack;
  std::size_t count = 0;
  stack[count++] = waiting_for(0);
  while (count > 0) {
    const auto [least, at] = stack[--count];
    if (least >= best.squared) continue;
    const Node& node = nodes_[at];
    for (std::uint32_t t = node.first; t < node.first + node.count; ++t) {
      const Corners corners = surface_.corners(t);
      const double found = squared_distance(point, corners, best.squared);
      if (found < best.squared && takes(corners)) best = {found, t};
    }
    if (node.count > 0) continue;
    std::tie(stack[count + 1], stack[count]) =
        std::minmax(waiting_for(at + 1), waiting_for(node.first));
    count += 2;
  }
  return best;
}

Nearest Tree::nearest(const Vec& point, std::uint32_t hint) const {
  if (nodes_.empty()) return {};
  const Nearest best = {squared_distance(point, surface_.corners(hint), kFar), hint};
  return nearest_of(point, best, [](const Corners&) { return true; });
}

bool Tree::has_near(const Vec& point, double distance, const Vec& normal) const {
  if (nodes_.empty()) return false;
  const double most = distance * distance;
  const auto faces = [&](const Corners& corners) { return dot(normal_of(corners), normal) > 0; };
  return nearest_of(point, {most, 0}, faces).squared < most;
}

}  // namespace isomesh::verify
