// The tube that simplification starts from; private to this folder.
//
// Crossings around a sample are joined into one vertex, as a surface that is regularised has them.
// Each vertex gets its places in T+ and T-, up and down along its normal. Where the tube is not
// clear of S or a triangle not upright, the vertex that is most often at fault steps back: a joined
// one becomes its crossings, and one of a single crossing goes to its lattice edge, with T+ and T-
// on the ways to the edge's two samples. A tube whose vertices are all there is clear.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "server/mesh/collapse/clusters.h"
#include "server/mesh/collapse/field.h"
#include "server/mesh/collapse/tube.h"
#include "server/mesh/context.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh::collapse {

// The surface that the tube is built around.
struct StartSurface {
  const Field& field;
  std::span<const Crossing> crossings;
  const Metric& metric;
  const Mesh& mesh;       // plain: a vertex for each crossing
  double reach_mm = 0;    // how far T+ and T- are from T
  bool is_moved = false;  // whether vertices are not on their lattice edges any more
  double rounding = 0;    // how far from a face of the volume a vertex in it may be, in samples
  std::span<const std::uint8_t> turned = {};  // by crossing, as leave_out returns it

  // True if a triangle of S with that corner has the order of the tube's.
  bool is_wound_as_tube(std::uint32_t corner) const {
    return metric.is_left_handed() != (!turned.empty() && turned[corner] != 0);
  }
};

// Nothing where single precision cannot tell the tube from S. The same for any number of threads.
std::optional<Tube> make_start(const StartSurface& surface, const Clusters& clusters,
                               const Context& context);

// A vertex that stepped back. On a cap, which is in a face of the volume, it stays there.
Vertex on_lattice_edge(const StartSurface& surface, std::size_t vertex);

}  // namespace isomesh::mesh::collapse
