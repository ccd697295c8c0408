// One label's own surface, taken out of the walls between all.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/buffer.h"
#include "server/mesh/context.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/measure/measure.h"
#include "server/mesh/topology/topology.h"

namespace isomesh::mesh {

// The triangles that have each label on either side. Takes 8 bytes for each triangle and each
// label. Does not refer to the surface afterwards. Immutable, so safe to read from several threads.
class LabelTriangles {
 public:
  // Throws Error kTooLarge when 32 bits cannot number all triangles.
  explicit LabelTriangles(const SeparatingSurface& surface);

  // The triangles of label number `number`, from 1 on (see WallSides), in the surface's order.
  std::span<const std::uint32_t> of(std::size_t number) const {
    return triangles_.span().subspan(ends_[number - 1], ends_[number] - ends_[number - 1]);
  }

 private:
  std::vector<std::uint64_t> ends_;  // ends_[n] of label n
  Buffer<std::uint32_t> triangles_;
};

// The surface of the label of that number, from 1 on, into `mesh`, whose memory is reused: the
// triangles that have it on either side, turned outward, in their order and their layers. It is an
// oriented manifold, and closed when the surface is. What two labels share has the same positions
// in both, to the bit. Thread safe for different meshes.
void extract_label(const SeparatingSurface& surface, const LabelTriangles& triangles,
                   std::size_t number, Mesh& mesh);

// Gives such a surface normals for shading: where it leaves the walls between labels, those of its
// outside alone. The mean with a wall, which its neighbour hides, would be right for neither, and
// edges would look dark. Thread safe for different meshes. Throws Error kCancelled.
void shade_label(const SeparatingSurface& surface, const LabelTriangles& triangles,
                 std::size_t number, const Context& context, Mesh& mesh);

// The walls' vertices that extract_label takes for that label, in the order of its surface.
std::vector<std::uint32_t> vertices_of_label(const SeparatingSurface& surface,
                                             const LabelTriangles& triangles, std::size_t number);

// The measures of one label's own surface.
struct LabelMeasure {
  std::int64_t label = 0;
  std::uint64_t vertices = 0;
  std::uint64_t triangles = 0;
  Topology topology;
  Extent extent;  // its volume is signed: negative only of a surface that is not closed

  bool is_closed() const { return topology.boundary_edges == 0; }
};

// Measures each label's surface, in the order of the labels. Each thread holds one label's surface
// at a time. The result is the same for any number of threads. Throws Error kCancelled.
std::vector<LabelMeasure> measure_labels(const SeparatingSurface& surface,
                                         const LabelTriangles& triangles, const Context& context);

// The area where two labels touch.
struct WallArea {
  std::size_t a = 0;  // the numbers of the labels, from 1 on; the smaller first
  std::size_t b = 0;  // 0: the background, and what lies beyond caps
  double area_mm2 = 0;
};

// The areas of all walls, ascending by `a`, then by `b`. A triangle belongs to each pair of a label
// that is only on one side of it and a label that is only on the other side; where the other side
// has no such label, to the background. If no labels overlap, that is one pair, and the areas add
// up to the surface's. The same for any number of threads. Throws Error kCancelled.
std::vector<WallArea> measure_walls(const SeparatingSurface& surface, const Context& context);

// The volume that all labels enclose together, in cubic millimetres. For an open surface it is
// defined as Extent::volume_mm3 is. The same for any number of threads. Throws Error kCancelled.
double enclosed_by_all(const SeparatingSurface& surface, const Context& context);

}  // namespace isomesh::mesh
