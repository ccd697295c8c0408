// Each label's own surface, taken out of the walls between all.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/buffer.h"
#include "server/mesh/context.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/labels/voxel_faces.h"
#include "server/mesh/measure/measure.h"
#include "server/mesh/topology/topology.h"

namespace isomesh::mesh {

// The surface of one label: the walls' triangles that have it on either side, turned outward, in
// their order and their layers. It is an oriented manifold, and closed when the walls are. What two
// labels share has the same positions in both, to the bit.
struct LabelSurface {
  Mesh mesh;
  Buffer<std::uint32_t> triangles;  // the number that each has in the walls
  Buffer<std::uint32_t> vertices;   // and each vertex

  // An upper estimate of the memory of all labels' surfaces, of walls of that size: a triangle is
  // in two of them at most, unless labels overlap.
  static std::uint64_t bytes(std::uint64_t vertices, std::uint64_t triangles);
};

// The surfaces of all labels, in the order of SeparatingSurface::labels. They do not refer to the
// walls. The same for any number of threads. Throws Error kTooLarge when 32 bits cannot number all
// triangles, and kCancelled.
std::vector<LabelSurface> label_surfaces(const SeparatingSurface& walls, const Context& context);

// The normals of a label's surface for shading: where it leaves the walls between labels, those of
// its outside alone. The mean with a wall, which its neighbour hides, would be right for neither,
// and edges would look dark. Throws Error kCancelled.
Buffer<Vec3> shading_of(const LabelSurface& label, const SeparatingSurface& walls,
                        const Context& context);

// The measures of one label's own surface.
struct LabelMeasure {
  std::int64_t label = 0;
  std::uint64_t vertices = 0;
  std::uint64_t triangles = 0;
  Topology topology;
  Extent extent;  // its volume is signed: negative only of a surface that is not closed

  bool is_closed() const { return topology.boundary_edges == 0; }
};

// Measures each label's surface, in the order of the labels. The same for any number of threads.
// Throws Error kCancelled.
std::vector<LabelMeasure> measure_labels(const SeparatingSurface& walls,
                                         std::span<const LabelSurface> labels,
                                         const Context& context);

// The area where two labels touch.
struct WallArea {
  std::size_t a = 0;  // the numbers of the labels, from 1 on; the smaller first
  std::size_t b = 0;  // 0: the background, and what lies beyond caps
  double area_mm2 = 0;
  std::uint64_t faces = 0;  // that voxels of the two share; none of those that meet at edges only
};

// The areas of all walls, and of pairs that share faces of voxels but have no triangle between them
// (any more), ascending by `a`, then by `b`. `faces`: those of the samples that the surface was
// made of. A triangle, or a face, belongs to each pair of a label that is only on one side of it
// and a label that is only on the other side; where the other side has no such label, to the
// background. If no labels overlap, that is one pair, and the areas add up to the surface's. The
// same for any number of threads. Throws Error kCancelled.
std::vector<WallArea> measure_walls(const SeparatingSurface& surface, const VoxelFaces& faces,
                                    const Context& context);

// The volume that all labels enclose together, in cubic millimetres. For an open surface it is
// defined as Extent::volume_mm3 is. The same for any number of threads. Throws Error kCancelled.
double enclosed_by_all(const SeparatingSurface& surface, const Context& context);

}  // namespace isomesh::mesh
