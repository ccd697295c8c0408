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

// Layers [begin, end). Signed, so that layers before the first may be spoken of.
struct LayerRange {
  std::ptrdiff_t begin = 0;
  std::ptrdiff_t end = 0;

  bool contains(std::ptrdiff_t layer) const { return layer >= begin && layer < end; }
};

// A copy of the positions of some consecutive layers.
struct LayerCopy {
  LayerRange layers;
  std::vector<Vec3> positions;
};

// Sums over one layer's vertices.
struct LayerDisplacement {
  double sum = 0;
  double largest = 0;
};

// What all slabs of a round of steps share.
struct Round {
  Mesh& mesh;
  std::span<const float> shares;  // of the way to the mean of the neighbours: one for each step
  double max_displacement_mm;
  std::span<const HalfSpace> within;  // that free vertices stay in
  // Where the vertices were extracted; null: where the round finds them.
  const Vec3* extracted;
  // By layer, to be added to: null where the round is not the first or not the last. Triangles that
  // name vertices of two slabs are left out.
  LayerExtent* before;
  LayerExtent* after;
  LayerDisplacement* displacements;

  std::ptrdiff_t layers() const { return static_cast<std::ptrdiff_t>(mesh.layers()); }
  std::size_t steps() const { return shares.size(); }
  std::uint64_t first_vertex(std::ptrdiff_t layer) const { return mesh.layer_vertices[layer]; }
};

// The slab and the layers around it that a sweep has to move too: one less on either side with each
// step.
LayerRange with_halo(const Round& round, const LayerRange& slab, std::size_t steps);

// Moves the vertices of the slab's layers by all steps of the round. `below` and `above` are copies
// of the other layers of with_halo(round, slab, steps), which other slabs write meanwhile.
// `on_layer` is called when one of the slab's layers is done, and may throw. Thread safe for
// different slabs.
void sweep(const Round& round, const LayerRange& slab, const LayerCopy& below,
           const LayerCopy& above, const std::function<void()>& on_layer);

// An upper bound of what a sweep of that many steps takes, in bytes for each vertex of the largest
// layer, on a mesh of at most kUsualNeighbors neighbours a vertex.
std::uint64_t sweep_bytes_per_vertex(std::size_t steps);

// Vertices with more are served too, though not as fast.
inline constexpr std::size_t kUsualNeighbors = 8;

}  // namespace isomesh::mesh
