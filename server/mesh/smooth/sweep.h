// Several steps of smoothing in one walk through the layers of a slab; private to this folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "server/mesh/measure/extent-inl.h"
#include "server/mesh/mesh.h"
#include "server/mesh/smooth/smooth.h"

namespace isomesh::mesh {

// Layers [begin, end); signed, because layers before the first occur.
struct LayerRange {
  std::ptrdiff_t begin = 0;
  std::ptrdiff_t end = 0;

  bool contains(std::ptrdiff_t layer) const { return layer >= begin && layer < end; }
};

// A copy of the positions of some consecutive layers.
struct LayerCopy {
  LayerRange layers;
  std::vector<Vec3> positions;

  const Vec3* layer(const Mesh& mesh, std::ptrdiff_t layer) const {
    return positions.data() + (mesh.layer_vertices[layer] - mesh.layer_vertices[layers.begin]);
  }
};

// Sums over the vertices of a layer, or of several.
struct LayerDisplacement {
  double sum = 0;
  double largest = 0;

  void add(const Vec3& extracted, const Vec3& moved);
};

// The vertices of a layer that go back to where they were extracted, because a triangle of theirs
// has no area after the last step: means put all corners of a component of a sample or two on one
// point.
struct FlatVertices {
  std::vector<std::uint32_t> vertices;  // some several times
  bool were_moved = false;              // after the layer was measured
};

// Adds the corners of triangles without area between the layer and the next. The caller lists those
// on both sides of a layer before it puts any back.
void list_flat(const Mesh& mesh, std::size_t layer, FlatVertices* flat);

// Puts the layer's listed vertices back, and sums the displacements anew if there are any.
// `extracted` holds its extracted positions.
void put_back(const Vec3* extracted, std::size_t layer, Mesh& mesh, FlatVertices& flat,
              LayerDisplacement& displacement);

// The shared data of all slabs of a round.
struct Round {
  Mesh& mesh;
  std::span<const float> shares;  // of the way to the mean of the neighbours: one for each step
  AtCurves at_curves;
  double max_displacement_mm;
  std::span<const HalfSpace> within;  // free vertices stay within them
  // The extracted positions; null if those before the round are.
  const Vec3* extracted;
  // Sums by layer; null except in the first and the last round. Triangles that name vertices of two
  // slabs are left out.
  LayerExtent* before;
  LayerExtent* after;
  LayerDisplacement* displacements;
  // By layer: vertices of triangles that the last round leaves without area.
  FlatVertices* flat;

  std::ptrdiff_t layers() const { return static_cast<std::ptrdiff_t>(mesh.layers()); }
  std::size_t steps() const { return shares.size(); }
  std::uint64_t first_vertex(std::ptrdiff_t layer) const { return mesh.layer_vertices[layer]; }
};

// The layers that a sweep has to move for a slab: one fewer on either side with each step.
LayerRange with_halo(const Round& round, const LayerRange& slab, std::size_t steps);

// Moves the vertices of the slab's layers by all steps of the round. `below` and `above` are copies
// of the other layers of with_halo(round, slab, steps), which other slabs write meanwhile.
// `on_layer` is called after each of the slab's layers, and may throw. In the last round, vertices
// of triangles without area are put back, except those of layers beside another slab, which are
// listed. Thread safe for different slabs.
void sweep(const Round& round, const LayerRange& slab, const LayerCopy& below,
           const LayerCopy& above, const std::function<void()>& on_layer);

// An upper bound of the memory of a sweep of this many steps, in bytes for each vertex of the
// largest layer, if no vertex has more than kUsualNeighbors neighbours.
std::uint64_t sweep_bytes_per_vertex(std::size_t steps);

// More neighbours are possible, but slower.
inline constexpr std::size_t kUsualNeighbors = 8;

}  // namespace isomesh::mesh
