#include "server/mesh/measure/measure.h"

#include <algorithm>
#include <vector>

#include "server/mesh/measure/extent-inl.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

constexpr std::size_t kLayersPerTask = 4;

}  // namespace

Extent measure_extent(const Mesh& mesh, const Context& context) {
  std::vector<LayerExtent> layers(mesh.layers());
  const std::size_t tasks = (layers.size() + kLayersPerTask - 1) / kLayersPerTask;
  parallel_for(context, tasks, [&](std::size_t task) {
    const std::size_t end = std::min(layers.size(), (task + 1) * kLayersPerTask);
    for (std::size_t layer = task * kLayersPerTask; layer < end; ++layer) {
      for (std::size_t v = mesh.layer_vertices[layer]; v < mesh.layer_vertices[layer + 1]; ++v) {
        layers[layer].add_vertex(load(mesh.positions[v]));
      }
      add_triangles(mesh, layer, layers[layer]);
    }
  });
  LayerExtent whole;
  for (const LayerExtent& layer : layers) whole.add(layer);
  return whole.extent();
}

}  // namespace isomesh::mesh
