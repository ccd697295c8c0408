// The mesh that every stage after extraction reads and writes.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "server/mesh/buffer.h"

namespace isomesh::mesh {

using Vec3 = std::array<float, 3>;              // millimetres, LPS
using Triangle = std::array<std::uint32_t, 3>;  // vertex indices, counter-clockwise from outside

// A box along the axes. Of nothing: its lowest corner is above its highest.
struct Reach {
  static constexpr float kFar = std::numeric_limits<float>::infinity();

  Vec3 low = {kFar, kFar, kFar};
  Vec3 high = {-kFar, -kFar, -kFar};

  bool is_empty() const { return low[0] > high[0]; }
  void add(const Reach& other) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], other.low[axis]);
      high[axis] = std::max(high[axis], other.high[axis]);
    }
  }
  bool holds(const Reach& other) const {
    bool is_within = true;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      is_within &= other.low[axis] >= low[axis] && other.high[axis] <= high[axis];
    }
    return is_within;
  }
};

inline constexpr std::size_t kFlagBits = 64;  // of a word of Mesh::on_border

// Vertices and triangles in the order of the lattice's layers. Layer k holds the vertices on the
// edges that the samples of plane k own and the triangles of the cells between planes k and k+1; of
// a surface that is closed, plane 0 is the one before the volume's first. So a triangle of layer k
// names only vertices of layers k and k+1, and work on a run of layers touches no others than those
// next to it.
//
// After extraction at an iso-value, every vertex lies on one lattice edge and every lattice edge
// carries at most one vertex. In a regularised surface, a vertex may be the mean of those around a
// sample of its layer. The surface is an oriented manifold. Its boundary, if it was not closed,
// lies on the border of the volume.
struct Mesh {
  std::array<double, 3> origin = {0, 0, 0};  // where the sample (0,0,0) lies
  // What smoothing does not leave as a rule: around the cells that the surface crosses, one sample
  // wider. Empty of a mesh that has lost components since, and of walls.
  Reach reach;
  Buffer<Vec3> positions;
  Buffer<Triangle> triangles;
  std::vector<std::uint64_t> layer_vertices;   // layers + 1 offsets into positions
  std::vector<std::uint64_t> layer_triangles;  // layers + 1 offsets into triangles

  // One bit per vertex: set if it lies on a cap or its rim. These are all the vertices on the
  // border of the volume. Empty if the surface was not closed: then its boundary vertices are
  // those.
  std::vector<std::uint64_t> on_border;

  // One bit per vertex that extraction made, of a mesh that has lost components since
  // (components.h): set if it is still there. Empty: all are.
  std::vector<std::uint64_t> kept;

  // One bit per vertex for walls between several labels (separate.h): set where more than two walls
  // meet. Empty for a surface with one inside and one outside.
  std::vector<std::uint64_t> on_line;

  // A unit vector for each vertex by which it is shaded. Empty: normals.h has those of the
  // triangles.
  std::vector<Vec3> normals;

  // False where on_line is empty.
  bool is_on_line(std::size_t vertex) const {
    return !on_line.empty() && (on_line[vertex / kFlagBits] >> (vertex % kFlagBits) & 1) != 0;
  }

  // False where on_border is empty.
  bool is_on_border(std::size_t vertex) const {
    return !on_border.empty() && (on_border[vertex / kFlagBits] >> (vertex % kFlagBits) & 1) != 0;
  }

  // Those of the layers [begin, end).
  std::span<const Triangle> triangles_of(std::size_t begin, std::size_t end) const {
    const std::uint64_t first = layer_triangles[begin];
    return triangles.span().subspan(first, layer_triangles[end] - first);
  }

  std::size_t layers() const { return layer_vertices.empty() ? 0 : layer_vertices.size() - 1; }
};

}  // namespace isomesh::mesh
