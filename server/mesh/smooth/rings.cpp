#include "server/mesh/smooth/rings.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "server/mesh/parallel.h"
#include "server/mesh/topology/vertex_fans.h"

namespace isomesh::mesh {
namespace {

// The triangles that name vertices of a layer: its own, and those of the layer below.
std::span<const Triangle> triangles_at(const Mesh& mesh, std::size_t layer) {
  return mesh.triangles_of(layer == 0 ? 0 : layer - 1, layer + 1);
}

template <class Visit>
void visit_corners(const Mesh& mesh, std::size_t layer, Visit visit) {
  const std::uint64_t first = mesh.layer_vertices[layer];
  const std::uint64_t count = mesh.layer_vertices[layer + 1] - first;
  for (const auto& [a, b, c] : triangles_at(mesh, layer)) {
    // A vertex before the first one wraps around.
    if (a - first < count) visit(a - first, Corner{b, c});
    if (b - first < count) visit(b - first, Corner{c, a});
    if (c - first < count) visit(c - first, Corner{a, b});
  }
}

// Puts each triangle behind the one that it shares a spoke with. False if they are not one fan.
bool sort_fan(std::span<Corner> fan) {
  if (fan.size() < 3 || fan.size() > Rings::kMostNeighbors) return false;
  for (std::size_t i = 0; i + 1 < fan.size(); ++i) {
    const auto rest = fan.subspan(i + 1);
    const auto found = std::ranges::find(rest, fan[i].previous, &Corner::next);
    if (found == rest.end()) return false;
    std::swap(*found, rest.front());
  }
  return fan.back().previous == fan.front().next;
}

}  // namespace

Rings::Rings(const Mesh& mesh, const Context& context) {
  const std::size_t layers = mesh.layers();
  begin_.resize_for_overwrite(mesh.positions.size() + 1);
  count_.resize_for_overwrite(mesh.positions.size());
  neighbors_.resize_for_overwrite(3 * mesh.triangles.size());

  // The number of triangles of each vertex; then where those of each layer's vertices begin.
  std::vector<std::uint64_t> layer_begin(layers + 1, 0);
  parallel_for(context, layers, [&](std::size_t layer) {
    std::uint64_t* counts = begin_.data() + mesh.layer_vertices[layer];
    std::fill_n(counts, mesh.layer_vertices[layer + 1] - mesh.layer_vertices[layer], 0);
    std::uint64_t corners = 0;
    visit_corners(mesh, layer, [&](std::size_t vertex, const Corner& /*corner*/) {
      ++counts[vertex];
      ++corners;
    });
    layer_begin[layer + 1] = corners;
  });
  for (std::size_t layer = 0; layer < layers; ++layer) layer_begin[layer + 1] += layer_begin[layer];
  begin_[mesh.positions.size()] = layer_begin[layers];

  parallel_for(context, layers, [&](std::size_t layer) {
    const std::uint64_t first = mesh.layer_vertices[layer];
    const std::size_t vertices = mesh.layer_vertices[layer + 1] - first;
    std::vector<Corner> corners(layer_begin[layer + 1] - layer_begin[layer]);
    std::vector<std::size_t> end(vertices);
    std::uint64_t next = layer_begin[layer];
    for (std::size_t v = 0; v < vertices; ++v) {
      end[v] = next - layer_begin[layer];
      next += std::exchange(begin_[first + v], next);
    }
    visit_corners(mesh, layer, [&](std::size_t vertex, const Corner& corner) {
      corners[end[vertex]++] = corner;
    });
    for (std::size_t v = 0; v < vertices; ++v) {
      const std::size_t from = begin_[first + v] - layer_begin[layer];
      const auto fan = std::span(corners).subspan(from, end[v] - from);
      count_[first + v] = sort_fan(fan) ? static_cast<std::uint8_t>(fan.size()) : 0;
      std::uint32_t* out = neighbors_.data() + begin_[first + v];
      for (const Corner& corner : fan) *out++ = corner.next;
    }
  });
}

}  // namespace isomesh::mesh
