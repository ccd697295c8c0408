// Triangles whose edges collapse one by one; private to this folder.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "server/mesh/collapse/simplify_block.h"

namespace isomesh::mesh {

using Numbers = std::vector<std::uint32_t>;

inline bool has(std::span<const std::uint32_t> numbers, std::uint32_t number) {
  return std::ranges::find(numbers, number) != numbers.end();
}

// Some triangles of a mesh with vertices of their own, and those around each vertex. A collapse
// draws a vertex into a neighbour. Not thread safe.
class EdgeCollapses {
 public:
  EdgeCollapses(const Mesh& mesh, std::span<const Triangle> triangles);

  // The triangles around a vertex that a collapse takes away, and those that it leaves.
  std::pair<Numbers, Numbers> split_star(std::uint32_t v, std::uint32_t into) const;

  // The third corner.
  std::uint32_t third(std::uint32_t triangle, std::uint32_t a, std::uint32_t b) const;

  // Ascending.
  Numbers neighbours(std::uint32_t v) const;

  // Link condition: collapsing the edge keeps the topology. The common neighbours of its ends must
  // be the third corners of `gone`, all different. No triangle at `v` may have only `v` and such
  // corners.
  bool links_meet_at_edge(std::uint32_t v, std::uint32_t into, const Numbers& gone) const;

  // The triangle as it is after a collapse.
  Triangle moved(std::uint32_t triangle, std::uint32_t v, std::uint32_t into) const;

  // True if no triangle in `kept` turns its normal far.
  bool stays_upright(std::uint32_t v, std::uint32_t into, const Numbers& kept) const;

  void collapse_edge(std::uint32_t v, std::uint32_t into, const Numbers& gone, const Numbers& kept);

 protected:
  bool are_neighbours(std::uint32_t a, std::uint32_t b) const;

  LocalMesh mesh_;
  std::vector<bool> is_gone_;    // of triangles
  std::vector<Numbers> around_;  // triangles of each vertex
};

}  // namespace isomesh::mesh
