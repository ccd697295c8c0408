// A tree of boxes over the triangles of a crowded cell; private to the kernels.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "server/mesh/measure/point_triangle.h"
#include "server/mesh/measure/surface_view.h"

namespace isomesh::mesh {

// A triangle in a cell of a TriangleGrid. `box` is where it lies in its cell, or, if a tree has the
// triangle, in its leaf.
struct TriangleInCell {
  std::uint32_t triangle;
  std::uint32_t box;
};

// Boxes in sixteenths of a cell. They have six fields of four bits and a spare bit: for each axis
// where the box begins, and how far before the cell's end it ends.
class BoxInCell {
 public:
  static constexpr std::uint32_t kSteps = 16;

  static std::uint32_t of(const std::array<std::uint32_t, 3>& first,
                          const std::array<std::uint32_t, 3>& last) {
    std::uint32_t packed = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      packed |= first[axis] << kFieldBits * axis;
      packed |= (kSteps - 1 - last[axis]) << kFieldBits * (axis + 3);
    }
    return packed;
  }
  static std::uint32_t first(std::uint32_t box, std::size_t axis) {
    return box >> kFieldBits * axis & (kSteps - 1);
  }
  static std::uint32_t last(std::uint32_t box, std::size_t axis) {
    return kSteps - 1 - first(box, axis + 3);
  }

  // The operand for comparing a box with others: where it ends, and where it begins.
  static std::uint32_t reach(const std::array<std::uint32_t, 3>& first,
                             const std::array<std::uint32_t, 3>& last) {
    return of(last, first);
  }
  static std::uint32_t reach_of(std::uint32_t box) {
    constexpr std::uint32_t kHalf = 3 * kFieldBits;
    constexpr std::uint32_t kFields = kSpareBits - (kSpareBits >> (kFieldBits - 1));
    const std::uint32_t opposite = ~box & kFields;
    return opposite >> kHalf | (opposite << kHalf & kFields);
  }
  static bool may_meet(std::uint32_t reach, std::uint32_t box) {
    return (((reach | kSpareBits) - box) & kSpareBits) == kSpareBits;
  }

 private:
  static constexpr std::uint32_t kFieldBits = 5;
  static constexpr std::uint32_t kSpareBits = 0b10000'10000'10000'10000'10000'10000;
};

// True if the line between two points meets the box.
bool line_meets(const Point& low, const Point& high, const Point& from, const Point& to);

// Halves the triangles again and again, so a search looks at few of them even if their edges are
// much longer in one direction than in another, or if they differ in size. The axes of the boxes
// follow the edges where these are longest at an angle, so boxes are narrow for any lattice. Takes
// some 16 bytes a triangle, and 48 more while it is built. Immutable, so safe to read from several
// threads.
class TriangleTree {
 public:
  using Entries = std::span<const TriangleInCell>;

  TriangleTree() = default;  // to be assigned

  // Reorders the entries of a cell, of which there must be one at least; the other functions need
  // them in this order. Positions must be finite.
  TriangleTree(const SurfaceView& surface, const Point& centre, double side_mm,
               std::span<TriangleInCell> entries);

  // Calls visit(entry) for the entries that may be within the reach of the point; those in nearer
  // boxes first. The reach may shrink meanwhile. Returns how many boxes it looked at.
  template <class Visit>
  std::uint64_t visit_near(Entries entries, const Point& point, const double& squared_reach,
                           Visit visit) const {
    const Point at = turned(minus(point, centre_));
    const Float4 at_lanes = lanes(at);
    // Single precision is enough near the cell only.
    const bool is_near = dot(at, at) < kNear * kNear * side_mm_ * side_mm_;
    const auto distance_to = [&](std::uint32_t number) {
      const Box& box = nodes_[number].box;
      return Waiting{number, is_near ? box.squared_distance_to(at_lanes) * kLess
                                     : box.squared_distance_to(at)};
    };
    std::uint64_t steps = 0;
    std::array<Waiting, kMostDepth + 1> waiting;
    std::size_t count = 0;
    waiting[count++] = distance_to(0);
    while (count > 0) {
      const auto [number, squared] = waiting[--count];
      ++steps;
      if (squared > squared_reach) continue;
      const Node& node = nodes_[number];
      if (node.is_leaf()) {
        steps += node.end - node.begin;
        const auto reach = static_cast<float>(std::sqrt(squared_reach));
        const std::uint32_t reached = node.box.reach_of({at_lanes - reach, at_lanes + reach});
        for (std::uint32_t i = node.begin; i < node.end; ++i) {
          if (!is_near || BoxInCell::may_meet(reached, entries[i].box)) visit(entries[i]);
        }
        continue;
      }
      Waiting near = distance_to(number + 1);
      Waiting far = distance_to(node.second);
      if (far.squared < near.squared) std::swap(near, far);
      waiting[count++] = far;
      waiting[count++] = near;
    }
    return steps;
  }

  // Calls visit(entry) for the entries that the line between two points may meet.
  template <class Visit>
  void visit_along(Entries entries, const Point& from, const Point& to, Visit visit) const {
    const Point begin = turned(minus(from, centre_));
    const Point end = turned(minus(to, centre_));
    const auto visit_leaf = [&](const Node& leaf) {
      for (std::uint32_t i = leaf.begin; i < leaf.end; ++i) {
        if (leaf.box.part(entries[i].box).is_on(begin, end)) visit(entries[i]);
      }
    };
    descend([&](const Node& node) { return node.box.is_on(begin, end); }, visit_leaf);
  }

  // Calls visit(i, k), with i < k, for the pairs of entries that may have a common point.
  template <class Visit>
  void visit_pairs(Entries entries, Visit visit) const {
    for (const Node& leaf : nodes_) {
      if (!leaf.is_leaf()) continue;
      const auto visit_leaf = [&](const Node& other) {
        for (std::uint32_t i = leaf.begin; i < leaf.end; ++i) {
          const Box box = leaf.box.part(entries[i].box);
          if (!box.meets(other.box)) continue;
          const std::uint32_t reached = other.box.reach_of(box);
          for (std::uint32_t k = std::max(i + 1, other.begin); k < other.end; ++k) {
            if (BoxInCell::may_meet(reached, entries[k].box)) visit(i, k);
          }
        }
      };
      const auto is_met = [&](const Node& node) {
        return node.end > leaf.begin && node.box.meets(leaf.box);
      };
      descend(is_met, visit_leaf);
    }
  }

  // Calls visit(entry) for the entries that may have a point in common with the triangle.
  template <class Visit>
  void visit_meeting(Entries entries, const Corners& corners, Visit visit) const {
    const Box box = box_of(corners);
    const auto visit_leaf = [&](const Node& leaf) {
      const std::uint32_t reached = leaf.box.reach_of(box);
      for (std::uint32_t i = leaf.begin; i < leaf.end; ++i) {
        if (BoxInCell::may_meet(reached, entries[i].box)) visit(entries[i]);
      }
    };
    descend([&](const Node& node) { return node.box.meets(box); }, visit_leaf);
  }

  std::size_t nodes() const { return nodes_.size(); }

 private:
  using Float4 = float __attribute__((vector_size(16)));  // the last lane is idle
  using Int4 = std::int32_t __attribute__((vector_size(16)));

  // More than rounding to single precision takes of a squared distance.
  static constexpr double kLess = 1 - 1e-6;
  // A rounding margin of places and boxes, as a share of the cell's side or of what is farther from
  // its centre.
  static constexpr float kRounding = 1e-6F;
  static constexpr double kNear = 4;  // sides from the centre
  // Between two halvings there is one other division at most, see build().
  static constexpr std::size_t kMostDepth = 2 * std::numeric_limits<std::uint32_t>::digits;

  struct Box {
    Float4 low;
    Float4 high;

    double squared_distance_to(const Point& at) const {
      double squared = 0;
      for (int axis = 0; axis < 3; ++axis) {
        const double from = at[static_cast<std::size_t>(axis)];
        const double outside = std::max({low[axis] - from, from - high[axis], 0.0});
        squared += outside * outside;
      }
      return squared;
    }
    double squared_distance_to(Float4 at) const {
      const Float4 before = low - at;
      const Float4 after = at - high;
      Float4 outside = before > after ? before : after;
      outside = outside > 0 ? outside : Float4{};
      const Float4 squares = outside * outside;
      return double{squares[0] + squares[1] + squares[2]};
    }
    bool meets(const Box& other) const {
      const Int4 is_apart = (low > other.high) | (other.low > high);
      return (is_apart[0] | is_apart[1] | is_apart[2]) == 0;
    }
    bool is_on(const Point& from, const Point& to) const {
      return line_meets({low[0], low[1], low[2]}, {high[0], high[1], high[2]}, from, to);
    }
    float longest_side() const {
      return std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
    }
    // A part of it, in steps.
    Box part(std::uint32_t box) const {
      const Float4 step = (high - low) / float{BoxInCell::kSteps};
      Box result = {low, high};
      for (int axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<std::size_t>(axis);
        result.low[axis] += step[axis] * static_cast<float>(BoxInCell::first(box, a));
        result.high[axis] -= step[axis] * static_cast<float>(15 - BoxInCell::last(box, a));
      }
      return result;
    }
    // For comparing its parts with another box.
    std::uint32_t reach_of(const Box& other) const {
      const Float4 slack = kRounding * (high - low);
      return BoxInCell::reach(steps_of(other.low - slack), steps_of(other.high + slack));
    }
    std::array<std::uint32_t, 3> steps_of(Float4 at) const {
      constexpr Float4 kLast = {15, 15, 15, 15};
      const Float4 side = high - low;
      at = (at - low) * float{BoxInCell::kSteps} / (side > 0 ? side : Float4{1, 1, 1, 1});
      at = at > 0 ? at : Float4{};
      const Int4 step = __builtin_convertvector(at < kLast ? at : kLast, Int4);
      return {static_cast<std::uint32_t>(step[0]), static_cast<std::uint32_t>(step[1]),
              static_cast<std::uint32_t>(step[2])};
    }
  };
  struct Member {
    Box box;
    TriangleInCell entry;
  };
  // The first child follows its parent.
  struct Node {
    Box box;
    std::uint32_t begin;  // of its entries
    std::uint32_t end;
    std::uint32_t second;  // child; 0 in a leaf

    bool is_leaf() const { return second == 0; }
  };
  struct Waiting {
    std::uint32_t node;
    double squared;
  };

  // Calls visit_leaf(node) for the leaves below nodes that are met.
  template <class IsMet, class VisitLeaf>
  void descend(IsMet is_met, VisitLeaf visit_leaf) const {
    std::array<std::uint32_t, kMostDepth + 1> waiting;
    std::size_t count = 0;
    waiting[count++] = 0;
    while (count > 0) {
      const std::uint32_t number = waiting[--count];
      const Node& node = nodes_[number];
      if (!is_met(node)) continue;
      if (node.is_leaf()) {
        visit_leaf(node);
        continue;
      }
      waiting[count++] = node.second;
      waiting[count++] = number + 1;
    }
  }

  Point turned(const Point& p) const {
    return {dot(axes_[0], p), dot(axes_[1], p), dot(axes_[2], p)};
  }
  static Float4 lanes(const Point& p) {
    return Float4{static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2]), 0};
  }
  Box box_of(const Corners& corners) const;
  static std::uint32_t packed(const Box& box, const Box& leaf);
  void build(std::span<Member> members, std::uint32_t first, bool may_part);
  static std::size_t part_large(std::span<Member> members, const Box& bounds);
  static std::size_t halve(std::span<Member> members);

  Point centre_ = {};
  double side_mm_ = 0;
  std::array<Point, 3> axes_ = {};
  std::vector<Node> nodes_;
};

}  // namespace isomesh::mesh
