// Finds where a tube that simplification may start from is not clear of S; private to this folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/collapse/start.h"
#include "server/mesh/collapse/tube.h"

namespace isomesh::mesh::collapse {

struct TubeStart {
  const StartSurface& surface;
  const Tube& tube;
  std::span<const std::uint32_t> vertex;     // of the tube, by crossing
  std::span<const std::uint8_t> is_unclear;  // by vertex: in T+ or T-
  std::span<const std::uint8_t> stepped;     // by vertex: on its lattice edge

  // The corners in the tube of triangle t of S. The triangle is empty if two of its crossings are
  // one vertex.
  Triangle corners(std::size_t t) const {
    const auto& [a, b, c] = surface.mesh.triangles[t];
    if (surface.is_wound_as_tube(a)) return {vertex[a], vertex[b], vertex[c]};
    return {vertex[a], vertex[c], vertex[b]};
  }
};

// Appends those of the triangles that are not upright, or where F has not one sign on a copy. An
// edge's signs are told by one of its triangles.
void find_faults(const TubeStart& start, std::span<const std::uint32_t> triangles,
                 std::vector<std::uint32_t>& faults);

}  // namespace isomesh::mesh::collapse
