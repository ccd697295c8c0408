#include "server/mesh/lattice/tetrahedra.h"

#include <algorithm>
#include <utility>

#include "server/mesh/points.h"

namespace isomesh::mesh {
namespace {

using Corner = std::uint8_t;
using Point = std::array<int, 3>;

Point position(Corner corner) { return {corner & 1, corner >> 1 & 1, corner >> 2 & 1}; }

struct Edge {
  Corner inside = 0;
  Corner outside = 0;

  EdgeName name() const { return edge_name(inside & outside, inside ^ outside); }
  Point middle() const { return plus(position(inside), position(outside)); }  // times two
};

// Adds the triangle with its normal towards `outward`; the midpoints of the edges tell the side.
void add_triangle(CellCase& out, Edge a, Edge b, Edge c, const Point& outward) {
  if (dot(normal_of(a.middle(), b.middle(), c.middle()), outward) < 0) std::swap(b, c);
  out.edges[out.triangles++] = {a.name(), b.name(), c.name()};
}

void add_tetrahedron(CellCase& out, const Tetrahedron& corners, unsigned inside_corners) {
  std::array<Corner, 4> inside = {};
  std::array<Corner, 4> outside = {};
  std::size_t insides = 0;
  std::size_t outsides = 0;
  Point outward = {0, 0, 0};  // from inside corners to outside ones, each pair once
  for (const Corner corner : corners) {
    if ((inside_corners >> corner & 1) != 0) {
      inside[insides++] = corner;
    } else {
      outside[outsides++] = corner;
    }
  }
  for (std::size_t i = 0; i < insides; ++i) {
    for (std::size_t o = 0; o < outsides; ++o) {
      outward = plus(outward, minus(position(outside[o]), position(inside[i])));
    }
  }
  if (insides == 1) {
    add_triangle(out, {inside[0], outside[0]}, {inside[0], outside[1]}, {inside[0], outside[2]},
                 outward);
  } else if (insides == 3) {
    add_triangle(out, {inside[0], outside[0]}, {inside[1], outside[0]}, {inside[2], outside[0]},
                 outward);
  } else if (insides == 2) {
    const Edge first = {inside[0], outside[0]};
    const Edge second = {inside[0], outside[1]};
    const Edge third = {inside[1], outside[1]};
    const Edge fourth = {inside[1], outside[0]};
    add_triangle(out, first, second, third, outward);
    add_triangle(out, first, third, fourth, outward);
  }
}

// When the program runs: the compiler would take seconds.
template <std::size_t N>
CellSplit make_split(const std::array<Tetrahedron, N>& tetrahedra) {
  CellSplit split;
  split.tetrahedra = N;
  std::ranges::copy(tetrahedra, split.corners.begin());
  for (unsigned inside = 0; inside < 256; ++inside) {
    for (std::size_t t = 0; t < N; ++t) {
      add_tetrahedron(split.cases[inside], split.corners[t], inside);
    }
  }
  // Every edge that corner 0 owns is an edge of one of its cell's tetrahedra.
  for (std::size_t t = 0; t < N; ++t) {
    for (const Corner a : split.corners[t]) {
      for (const Corner b : split.corners[t]) {
        if (a < b && (a & b) == 0) split.ends[a ^ b] = {a, b};
      }
    }
  }
  for (unsigned inside = 0; inside < 256; ++inside) {
    for (unsigned direction = 1; direction < 8; ++direction) {
      const EdgeEnds ends = split.ends[direction];
      const bool crossed = ((inside >> ends.from ^ inside >> ends.to) & 1) != 0;
      split.crossed[inside] |= static_cast<std::uint8_t>(crossed ? 1U << direction : 0);
    }
  }
  return split;
}

}  // namespace

CellCase tetrahedron_case(const Tetrahedron& corners, unsigned inside) {
  CellCase result;
  add_tetrahedron(result, corners, inside);
  return result;
}

PlacedTriangles placed_triangles(const CellSplit& split) {
  PlacedTriangles placed = {};
  for (unsigned inside = 0; inside < split.cases.size(); ++inside) {
    const auto& edges = split.cases[inside].edges;
    std::size_t next = 0;
    for (std::size_t t = 0; t < split.tetrahedra; ++t) {
      int corners = 0;
      for (const Corner corner : split.corners[t])
        corners += static_cast<int>(inside >> corner & 1);
      const std::size_t triangles = corners == 2 ? 2 : corners == 1 || corners == 3 ? 1 : 0;
      for (std::size_t i = 0; i < triangles; ++i) {
        std::ranges::copy(edges[next++], placed[inside][2 * t + i].begin());
      }
    }
  }
  return placed;
}

const CellSplit& cell_split(Scheme scheme, bool odd) {
  static const CellSplit six = make_split(kSixTetrahedra);
  static const CellSplit five_even = make_split(kFiveTetrahedraEven);
  static const CellSplit five_odd = make_split(kFiveTetrahedraOdd);
  if (scheme != Scheme::kFive) return six;
  return odd ? five_odd : five_even;
}

}  // namespace isomesh::mesh
