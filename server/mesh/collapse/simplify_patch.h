// Collapses that are measured or only counted, in some triangles of a surface; private to this
// folder.
#pragma once

#include <cstddef>
#include <cstdint>

#include "server/mesh/collapse/history.h"
#include "server/mesh/collapse/kept_points.h"
#include "server/mesh/collapse/patches.h"
#include "server/mesh/context.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh::collapse {

struct SimplifySurroundings {
  const Context& context;        // looked at now and then for whether to stop
  const Mesh& mesh;              // whose vertices and numbers are taken
  double unit_mm = 1;            // near the length of edges: quadrics have single precision
  KeptPoints* points = nullptr;  // none if nothing is measured
  History* history = nullptr;    // where collapses are noted, if anywhere
  double max_error_mm = 0;       // of the points
  std::uint32_t step = 0;        // of the first collapse, for the history
};

// Draws vertices into neighbours until `least` triangles are left. Those that stay or have not one
// closed fan of triangles do not go, and no edge between two of them is made. The surface stays of
// its kind, and no triangle turns far. `is_last`: goes on until nothing is left to try, turning
// triangles far if that is the last way. Thread safe for different patches.
// Throws Error kCancelled.
void simplify_patch(const SimplifySurroundings& around, std::size_t least, bool is_last,
                    Patch& patch);

}  // namespace isomesh::mesh::collapse
