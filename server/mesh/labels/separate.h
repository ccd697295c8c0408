// The surface that separates the labels of a segmentation from each other and from the background:
// all labels in one walk, and one wall between two neighbours, whose vertices both have.
//
// G. M. Nielson, R. Franke, "Computing the separating surface for segmented data", IEEE
// Visualization 1997 (also J. Bloomenthal, K. Ferguson, "Polygonization of non-manifold implicit
// surfaces", SIGGRAPH 1995). The lattice is split into tetrahedra as in extract.h. An edge whose
// ends have different labels carries a vertex at its middle; a face with three different labels has
// one at the mean of its corners, and so has a tetrahedron with four (wall_cases.h). Two labels
// give the mesh that extract.h makes with midpoints at an iso-value between them.
//
// A surface that is to be closed is marched on around the volume, as if one more layer of samples
// beyond each face were background. Labels have no values, and a sample stands for the voxel around
// it: caps lie half a step beyond the outermost samples, where their voxels end; the edges of that
// box are bevelled. (Caps of an iso-value lie in the outermost samples themselves, border.h.)
#pragma once

#include <compare>
#include <cstdint>
#include <map>
#include <vector>

#include "server/mesh/buffer.h"
#include "server/mesh/context.h"
#include "server/mesh/extract/extract.h"
#include "server/mesh/labels/label_parts.h"
#include "server/mesh/lattice/lattice.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// So many labels at most beside the background.
inline constexpr std::size_t kMostLabels = Volume::kMostLabels;

struct SeparateOptions {
  // The values to separate, each once, ascending, at most kMostLabels and without the background's:
  // as select_labels (labels.h) gives them. All other values are background: a label's surface is
  // whole whatever its neighbours are, and between two values that are not listed there is no wall.
  std::vector<std::int64_t> labels;
  Scheme scheme = Scheme::kSix;  // kFive or kSix; others throw Error kInvalidParameter
  bool close = false;            // cap labels where they meet the lattice's border
  bool regularize = false;       // join the vertices around a sample, see label_clusters-inl.h
  // For labels that are not the samples of their own value: all values whose samples belong to
  // them. One value may belong to several labels; what overlaps is separated from what does not.
  std::map<std::int64_t, std::vector<std::int64_t>> values = {};
};

// The parts on the two sides of a triangle, by the numbers of LabelParts. 0 is the background; 1 is
// the first of SeparateOptions::labels if none of them has other values. A triangle is
// counter-clockwise seen from `front`, the smaller number. So the background is always in front.
struct WallSides {
  PartNumber front = 0;
  PartNumber back = 0;

  auto operator<=>(const WallSides&) const = default;
};

// The sample that a vertex was made for: of those around it that with the largest number of a part,
// which owns the crossings to all others (label_clusters-inl.h).
struct VertexOwner {
  std::uint64_t sample : 45 = 0;  // of the lattice, x fastest
  // To the neighbours (links.h) that the vertex is the crossing to. None of a vertex that is only
  // the point of a face or of a tetrahedron.
  std::uint64_t directions : 18 = 0;
  // The sample has one other label around it, and no crossing that is another vertex.
  std::uint64_t is_whole : 1 = 0;
};

// The walls between all labels. `mesh` has the layers that mesh.h tells of; it is no manifold where
// three labels meet: mesh.on_line are the vertices in faces and centres, and those that such
// vertices were joined in. An edge between two of them lies on a curve if three triangles have it;
// two do if it crosses a wall, which happens where vertices were joined. Of a closed surface,
// mesh.on_border are the vertices of the caps and all others in the faces of the box of the
// samples. The walls around one label alone are an oriented manifold: see label_surface.h.
struct SeparatingSurface {
  Mesh mesh;
  Buffer<WallSides> sides;           // of each triangle
  Buffer<VertexOwner> owners;        // of each vertex, until any is moved to another place
  std::vector<std::int64_t> labels;  // ascending
  LabelParts parts;                  // whose sides these are
};

// Counts without writing; exact. A lattice without cells, or with one label alone and not closed,
// has no walls. For the six integer types of SampleType. Thread safe. Throws Error kCancelled.
template <class T>
SurfaceCount count_walls(const Lattice<T>& lattice, const SeparateOptions& options,
                         const Context& context);

// How many triangles the surface of each label alone has (label_surface.h), by its place in
// SeparateOptions::labels from 1 on. `count` must come from count_walls with the same lattice and
// options. Each thread has some layers of the walls at a time. Thread safe. Throws Error
// kCancelled.
template <class T>
std::vector<std::uint64_t> count_label_triangles(const Lattice<T>& lattice,
                                                 const SeparateOptions& options,
                                                 const SurfaceCount& count, const Context& context);

// Makes the walls in `surface`, whose memory is reused; beside it each thread takes
// wall_writing_memory. `count` must come from count_walls with the same lattice and options. The
// result does not depend on the number of threads. Thread safe for different surfaces. Throws Error
// kTooLarge when 32-bit indices cannot name all vertices, before memory is taken, and kCancelled.
template <class T>
void extract_walls(const Lattice<T>& lattice, const SeparateOptions& options,
                   const SurfaceCount& count, const Context& context, SeparatingSurface& surface);

// The memory in which each thread writes walls, in bytes. The volume's planes have so many samples.
std::uint64_t wall_writing_memory(std::uint64_t plane_samples);

}  // namespace isomesh::mesh
