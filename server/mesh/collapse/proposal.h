// One attempt to simplify a surface; private to this folder.
#pragma once

#include <cstdint>
#include <vector>

#include "server/mesh/collapse/history.h"
#include "server/mesh/collapse/misses.h"
#include "server/mesh/collapse/simplify.h"
#include "server/mesh/context.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// A simplified surface.
struct Proposal {
  SimplificationEffect effect;
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> numbers;  // of each: that of the original triangle that became it
  collapse::History history;
  std::vector<Vec3> places = {};  // of the original vertices, where they have moved to
  std::vector<std::uint8_t> is_moved_back = {};  // of the original vertices, by repairs
};

// The surface as it was, from which the error is measured.
struct Original {
  const WalledSurface& surface;
  const WallGrids* grids = nullptr;  // of it; none if nothing is measured
};

// The error is measured at vertices, middles of edges and centres of triangles only. `walls` are
// whose mesh it is, if any. The same for any number of threads. Throws as simplify.
Proposal propose(const SimplifyOptions& options, const Context& context, const Mesh& mesh,
                 const SeparatingSurface* walls, const Original& original);

}  // namespace isomesh::mesh
