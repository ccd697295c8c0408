// The three passes over the slabs of whatever is marched over, an iso-value's samples or labels;
// private to the kernels.
#pragma once

#include <cstdint>
#include <numeric>
#include <vector>

#include "server/mesh/extract/slabs.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh {

// Cuts the layers into runs of about equal cost; `cost(k)` is the running cost up to layer k.
template <class RunningCost>
std::vector<Slab> cut_slabs(std::uint32_t layers, RunningCost cost) {
  // Enough slabs that the threads end together, few enough that the plane which two slabs both
  // number costs little.
  const auto slabs = static_cast<std::size_t>(thread_count()) * 6;
  const double step = static_cast<double>(cost(layers)) / static_cast<double>(slabs);
  std::vector<Slab> result;
  std::uint32_t begin = 0;
  for (std::uint32_t end = 1; end <= layers; ++end) {
    const double goal = step * static_cast<double>(result.size() + 1);
    if (end < layers && static_cast<double>(cost(end)) < goal) continue;
    result.push_back({begin, end});
    begin = end;
  }
  return result;
}

// No vertices and no triangles in each of the layers.
inline SurfaceCount empty_count(std::uint32_t layers) {
  SurfaceCount count;
  count.layer_vertices.assign(std::size_t{layers} + 1, 0);
  count.layer_triangles.assign(std::size_t{layers} + 1, 0);
  count.crossed.assign(layers, {});
  return count;
}

// Pass 1: how many vertices and triangles each layer has, in the place behind the layer's. `ended`:
// see count_slab.
template <class Marched, class... Ended>
void count_pass(const Marched& marched, const Context& context, SurfaceCount& count,
                const Ended&... ended) {
  const auto slabs = cut_slabs(marched.dims.z, [](std::uint32_t z) { return z; });
  parallel_for(context, slabs.size(),
               [&](std::size_t task) { count_slab(marched, slabs[task], count, ended...); });
}

// Pass 2: where each layer begins.
inline void prefix_pass(SurfaceCount& count) {
  for (std::size_t k = 1; k < count.clusters.size(); ++k) {
    count.layer_vertices[k] -= count.clusters[k].vertices_below;
    count.layer_triangles[k] -= count.clusters[k].triangles_below;
  }
  for (auto* sums : {&count.layer_vertices, &count.layer_triangles}) {
    std::partial_sum(sums->begin(), sums->end(), sums->begin());
  }
}

// Room for the surface, whose layers the mesh has then. Throws Error kTooLarge when there are more
// vertices than 32-bit indices can name, before memory is taken.
void make_room(const SurfaceCount& count, const LatticeToSpace& to_space, bool close, Mesh& mesh);

// Pass 3: every vertex and triangle to its place in `output`, which the layers of its mesh tell.
// `places`: the indices that are held for each sample.
template <class Marched, class Output>
void write_pass(const Marched& marched, std::size_t places, const Context& context,
                const Mesh& mesh, Output& output) {
  const Dims& dims = marched.dims;
  IndexMemory memory(index_memory_size(dims, places));
  // A layer costs its triangles, and its samples even when it is empty.
  const std::uint64_t samples_cost = std::uint64_t{dims.x} * dims.y / 16;
  const auto slabs = cut_slabs(
      dims.z, [&](std::uint32_t z) { return mesh.layer_triangles[z] + z * samples_cost; });
  parallel_for(context, slabs.size(),
               [&](std::size_t task) { write_slab(marched, slabs[task], memory, output); });
}

}  // namespace isomesh::mesh
