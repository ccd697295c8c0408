// The nearest triangle of a surface.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "client/verify/surface.h"

namespace isomesh::verify {

// The square of the distance. Triangles without an area are segments or points.
double squared_distance(const Vec& point, const Corners& triangle);

struct Nearest {
  double squared = std::numeric_limits<double>::infinity();
  std::uint32_t triangle = 0;
};

// A tree of boxes. Immutable once made, so safe to use from several threads.
class Tree {
 public:
  // Puts the triangles of the surface into another order: those of a box are neighbours. The
  // surface must outlive this, and keep that order.
  explicit Tree(Surface& surface);

  // The nearest triangle to a point, or `hint` if none is nearer. Infinitely far if there is none.
  Nearest nearest(const Vec& point, std::uint32_t hint) const;

  const Surface& surface() const { return surface_; }

 private:
  static constexpr double kFar = std::numeric_limits<double>::infinity();

  struct Node {
    std::uint32_t first = 0;  // of a leaf: its first triangle; else the second child
    std::uint32_t count = 0;  // triangles of a leaf; else 0, and the first child is the next node
    Vec low = {kFar, kFar, kFar};
    Vec high = {-kFar, -kFar, -kFar};
  };
  struct Item {
    Vec centre;
    std::array<std::uint32_t, 3> triangle;
  };

  void build(std::vector<Item>& items, std::uint32_t begin, std::uint32_t end);

  const Surface& surface_;
  std::vector<Node> nodes_;
};

}  // namespace isomesh::verify
