#include "server/mesh/labels/star_points.h"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <set>
#include <span>

#include "server/mesh/labels/wall_cases.h"

namespace isomesh::mesh {
namespace {

class PointFinder {
 public:
  explicit PointFinder(Scheme scheme)
      : links_(links_of(scheme)),
        cases_{make_wall_cases(scheme, false, false), make_wall_cases(scheme, true, false)} {}

  StarPoints around(unsigned parity) const {
    std::array<std::set<Directions>, 3> found;  // by the number of neighbours less one
    for (const auto& triangles : {links_.above(parity), links_.below(parity)}) {
      for (const Directions all : triangles) {
        for (Directions some = all; some != 0; some = (some - 1) & all) {
          found[static_cast<std::size_t>(std::popcount(some)) - 1].insert(some);
        }
      }
    }
    StarPoints points;
    points[0].resize(links_.directions().size());
    for (const Directions edge : found[0]) {
      points[0][static_cast<std::size_t>(std::countr_zero(edge))] = point(edge, parity);
    }
    for (std::size_t kind = 1; kind < points.size(); ++kind) {
      for (const Directions set : found[kind]) points[kind].push_back(point(set, parity));
    }
    return points;
  }

 private:
  StarPoint point(Directions neighbours, unsigned parity) const {
    StarPoint point = {.neighbours = neighbours};
    std::array<int, 3> low = {0, 0, 0};
    std::size_t count = 0;
    for (Directions rest = neighbours; rest != 0; rest &= rest - 1) {
      const auto d = static_cast<std::uint8_t>(std::countr_zero(rest));
      point.members[count++] = d;
      const auto& step = links_.directions()[d].step;
      for (std::size_t axis = 0; axis < 3; ++axis) low[axis] = std::min(low[axis], step[axis]);
    }
    point.corner = corner_from(low, {0, 0, 0});
    point.is_below = low[2] < 0;
    unsigned corners = 1U << point.corner;
    for (const std::uint8_t d : std::span(point.members).first(count)) {
      corners |= 1U << corner_from(low, links_.directions()[d].step);
    }
    const auto& slots = cases_[point.owner_parity(parity)].slots;
    const auto found = std::ranges::find_if(slots, [&](const Slot& slot) {
      unsigned set = 0;
      for (std::size_t i = 0; i < slot.size; ++i) set |= 1U << slot.corners[i];
      return set == corners;
    });
    point.slot = static_cast<std::uint8_t>(found - slots.begin());
    return point;
  }

  static std::uint8_t corner_from(const std::array<int, 3>& low, const std::array<int, 3>& to) {
    unsigned corner = 0;
    for (unsigned axis = 0; axis < 3; ++axis) {
      corner |= static_cast<unsigned>(to[axis] - low[axis]) << axis;
    }
    return static_cast<std::uint8_t>(corner);
  }

  const Links& links_;
  std::array<WallCases, 2> cases_;
};

std::array<StarPoints, 2> find_points(Scheme scheme) {
  const PointFinder finder(scheme);
  return {finder.around(0), finder.around(1)};
}

}  // namespace

const std::array<StarPoints, 2>& star_points(Scheme scheme) {
  static const std::array<StarPoints, 2> six = find_points(Scheme::kSix);
  static const std::array<StarPoints, 2> five = find_points(Scheme::kFive);
  return scheme == Scheme::kSix ? six : five;
}

}  // namespace isomesh::mesh
