#include "server/mesh/measure/measure.h"

#include <vector>

#include "server/mesh/measure/extent-inl.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

constexpr std::size_t kLayersPerTask = 4;

}  // namespace

Extent measure_extent(const Mesh& mesh, const Context& context) {
  std::vector<LayerExtent> layers(mesh.layers());
  const auto measure = [&](std::size_t layer) {
    for (std::size_t v = mesh.layer_vertices[layer]; v < mesh.layer_vertices[layer + 1]; ++v) {
      layers[layer].add_vertex(load(mesh.positions[v]));
    }
    add_triangles(mesh, layer, layers[layer]);
  };
  for_each(context, layers.size(), measure, kLayersPerTask);
  LayerExtent whole;
  for (const LayerExtent& layer : layers) whole.add(layer);
  return whole.extent();
}

}  // namespace isomesh::mesh
