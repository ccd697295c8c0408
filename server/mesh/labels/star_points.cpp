#include "server/mesh/labels/star_points.h"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <set>
#include <span>

#include "server/mesh/labels/wall_cases.h"

namespace isomesh::mesh {
namespace {

std::uint8_t corner_from(const std::array<int, 3>& low, const std::array<int, 3>& to) {
  unsigned corner = 0;
  for (unsigned axis = 0; axis < 3; ++axis) {
    corner |= static_cast<unsigned>(to[axis] - low[axis]) << axis;
  }
  return static_cast<std::uint8_t>(corner);
}

// `cases`: by parity.
StarPoint point_with(Directions neighbours, unsigned parity, const Links& links,
                     const std::array<WallCases, 2>& cases) {
  StarPoint point = {.neighbours = neighbours};
  std::array<int, 3> low = {0, 0, 0};
  std::size_t count = 0;
  for (Directions rest = neighbours; rest != 0; rest &= rest - 1) {
    const auto d = static_cast<std::uint8_t>(std::countr_zero(rest));
    point.members[count++] = d;
    const auto& step = links.directions()[d].step;
    for (std::size_t axis = 0; axis < 3; ++axis) low[axis] = std::min(low[axis], step[axis]);
  }
  point.corner = corner_from(low, {0, 0, 0});
  point.is_below = low[2] < 0;
  unsigned corners = 1U << point.corner;
  for (const std::uint8_t d : std::span(point.members).first(count)) {
    corners |= 1U << corner_from(low, links.directions()[d].step);
  }
  const auto& slots = cases[point.owner_parity(parity)].slots;
  point.slot =
      static_cast<std::uint8_t>(std::ranges::find(slots, corners, &Slot::set) - slots.begin());
  return point;
}

std::array<StarPoints, 2> find_points(Scheme scheme) {
  const Links& links = links_of(scheme);
  const std::array cases = {make_wall_cases(scheme, false, false),
                            make_wall_cases(scheme, true, false)};
  std::array<StarPoints, 2> points;
  for (unsigned parity = 0; parity < 2; ++parity) {
    std::set<Directions> found;
    for (const auto& triangles : {links.above(parity), links.below(parity)}) {
      for (const Directions all : triangles) {
        for (Directions some = all; some != 0; some = (some - 1) & all) found.insert(some);
      }
    }
    auto& [edges, faces, centres] = points[parity];
    edges.resize(links.directions().size());
    for (const Directions set : found) {
      const StarPoint point = point_with(set, parity, links, cases);
      switch (std::popcount(set)) {
        case 1:
          edges[point.members[0]] = point;
          break;
        case 2:
          faces.push_back(point);
          break;
        default:
          centres.push_back(point);
      }
    }
  }
  return points;
}

}  // namespace

const std::array<StarPoints, 2>& star_points(Scheme scheme) {
  static const std::array<StarPoints, 2> six = find_points(Scheme::kSix);
  static const std::array<StarPoints, 2> five = find_points(Scheme::kFive);
  return scheme == Scheme::kSix ? six : five;
}

}  // namespace isomesh::mesh
