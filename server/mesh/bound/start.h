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

#include "server/mesh/bound/clusters.h"
#include "server/mesh/bound/field.h"
#include "server/mesh/bound/tube.h"
#include "server/mesh/context.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh::bound {

struct StartOptions {
  double reach_mm = 0;    // how far T+ and T- are from T
  bool is_moved = false;  // whether vertices are not on their lattice edges any more
};

// `mesh`: the surface that is not regularised, a vertex for each of `crossings`. Nothing where
// single precision cannot tell the tube from S. The same for any number of threads.
std::optional<Tube> make_start(const Field& field, std::span<const Crossing> crossings,
                               const Clusters& clusters, const Metric& metric,
                               const StartOptions& options, const Mesh& mesh,
                               const Context& context);

// A vertex that stepped back.
Vertex on_lattice_edge(const Field& field, const Crossing& crossing, const Metric& metric,
                       double reach_mm);

}  // namespace isomesh::mesh::bound
