#include "server/mesh/labels/wall_fans.h"

#include <algorithm>
#include <limits>
#include <string>
#include <tuple>

#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

struct Corner {
  std::uint32_t vertex = 0;  // counted from the layer's first
  Wall wall;
  Spoke spoke;
};

std::tuple<PartNumber, PartNumber, bool> key_of(const Wall& wall) {
  return {wall.sides.front, wall.sides.back, wall.is_cap};
}

// Fans of the vertices of one layer.
struct LayerFans {
  std::vector<std::uint32_t> fans;  // of each vertex
  std::vector<Wall> walls;
  std::vector<std::uint32_t> sizes;  // in spokes
  std::vector<Spoke> spokes;
};

// The corners at a layer's vertices, in the order of the triangles.
std::vector<Corner> corners_of(const SeparatingSurface& surface, std::size_t layer,
                               const std::function<bool(const Triangle&)>& is_cap) {
  const Mesh& mesh = surface.mesh;
  const std::uint64_t first = mesh.layer_vertices[layer];
  const std::uint64_t count = mesh.layer_vertices[layer + 1] - first;
  std::vector<Corner> corners;
  const std::uint64_t begin = mesh.layer_triangles[layer == 0 ? 0 : layer - 1];
  for (std::uint64_t t = begin; t < mesh.layer_triangles[layer + 1]; ++t) {
    const Triangle& triangle = mesh.triangles[t];
    const auto is_here = [&](std::uint32_t v) { return v - first < count; };
    if (std::ranges::none_of(triangle, is_here)) continue;
    const Wall wall = {surface.sides[t], is_cap(triangle)};
    for (std::size_t i = 0; i < 3; ++i) {
      if (!is_here(triangle[i])) continue;
      corners.push_back({static_cast<std::uint32_t>(triangle[i] - first),
                         wall,
                         {triangle[(i + 1) % 3], triangle[(i + 2) % 3]}});
    }
  }
  return corners;
}

std::vector<Corner> sorted_by_vertex(const std::vector<Corner>& corners, std::size_t vertices) {
  std::vector<std::uint32_t> next(vertices + 1, 0);
  for (const Corner& corner : corners) ++next[corner.vertex + 1];
  for (std::size_t v = 0; v < vertices; ++v) next[v + 1] += next[v];
  std::vector<Corner> sorted(corners.size());
  for (const Corner& corner : corners) sorted[next[corner.vertex]++] = corner;
  return sorted;
}

LayerFans fans_of(const SeparatingSurface& surface, std::size_t layer,
                  const std::function<bool(const Triangle&)>& is_cap) {
  const std::size_t vertices =
      surface.mesh.layer_vertices[layer + 1] - surface.mesh.layer_vertices[layer];
  std::vector<Corner> corners = sorted_by_vertex(corners_of(surface, layer, is_cap), vertices);
  LayerFans result;
  result.fans.assign(vertices, 0);
  for (auto at = corners.begin(); at != corners.end();) {
    const auto end =
        std::find_if(at, corners.end(), [&](const Corner& c) { return c.vertex != at->vertex; });
    const bool is_one_wall =
        std::all_of(at, end, [&](const Corner& corner) { return corner.wall == at->wall; });
    const auto by_wall = [](const Corner& corner) { return key_of(corner.wall); };
    if (!is_one_wall) std::ranges::stable_sort(at, end, {}, by_wall);
    for (; at != end; ++at) {
      if (result.fans[at->vertex] == 0 || result.walls.back() != at->wall) {
        ++result.fans[at->vertex];
        result.walls.push_back(at->wall);
        result.sizes.push_back(0);
      }
      ++result.sizes.back();
      result.spokes.push_back(at->spoke);
    }
  }
  return result;
}

}  // namespace

WallFans::WallFans(const SeparatingSurface& surface,
                   const std::function<bool(const Triangle&)>& is_cap, const Context& context) {
  const Mesh& mesh = surface.mesh;
  const std::size_t layers = mesh.layers();
  std::vector<LayerFans> all(layers);
  parallel_for(context, layers,
               [&](std::size_t layer) { all[layer] = fans_of(surface, layer, is_cap); });

  std::vector<std::uint64_t> fans_before(layers + 1, 0);
  std::vector<std::uint64_t> spokes_before(layers + 1, 0);
  for (std::size_t layer = 0; layer < layers; ++layer) {
    fans_before[layer + 1] = fans_before[layer] + all[layer].walls.size();
    spokes_before[layer + 1] = spokes_before[layer] + all[layer].spokes.size();
  }
  if (fans_before[layers] > std::numeric_limits<std::int32_t>::max()) {
    throw Error(ErrorCode::kTooLarge,
                "the walls between the labels have too many vertices: 31 "
                "bits cannot number what smoothing needs for each");
  }
  first_.resize_for_overwrite(mesh.positions.size() + 1);
  vertex_.resize_for_overwrite(fans_before[layers]);
  walls_.resize_for_overwrite(fans_before[layers]);
  spokes_begin_.resize_for_overwrite(fans_before[layers] + 1);
  spokes_.resize_for_overwrite(spokes_before[layers]);
  first_[mesh.positions.size()] = static_cast<std::uint32_t>(fans_before[layers]);
  spokes_begin_[fans_before[layers]] = spokes_before[layers];
  parallel_for(context, layers, [&](std::size_t layer) {
    LayerFans& here = all[layer];
    std::ranges::copy(here.walls, walls_.begin() + fans_before[layer]);
    std::ranges::copy(here.spokes, spokes_.begin() + spokes_before[layer]);
    std::uint64_t fan = fans_before[layer];
    std::uint64_t spoke = spokes_before[layer];
    for (std::size_t v = 0; v < here.fans.size(); ++v) {
      const std::uint64_t vertex = mesh.layer_vertices[layer] + v;
      first_[vertex] = static_cast<std::uint32_t>(fan);
      for (std::uint32_t n = 0; n < here.fans[v]; ++n, ++fan) {
        vertex_[fan] = static_cast<std::uint32_t>(vertex);
        spokes_begin_[fan] = spoke;
        spoke += here.sizes[fan - fans_before[layer]];
      }
    }
    here = {};
  });
  find_neighbors(context);
}

std::uint32_t WallFans::find(std::size_t vertex, const Wall& wall) const {
  for (std::uint32_t fan = first_[vertex]; fan < first_[vertex + 1]; ++fan) {
    if (walls_[fan] == wall) return fan;
  }
  return kNone;
}

void WallFans::find_neighbors(const Context& context) {
  neighbors_ = Rings(size(), context, [&](std::size_t fan, std::vector<std::uint32_t>& list) {
    for (const Spoke& spoke : spokes(fan)) list.push_back(spoke.next);
    // A fan that is open has an end that is only a previous corner.
    for (const Spoke& spoke : spokes(fan)) {
      if (std::ranges::find(list, spoke.previous) == list.end()) list.push_back(spoke.previous);
    }
    for (std::uint32_t& each : list) each = find(each, walls_[fan]);
  });
}

std::uint64_t WallFans::bytes(std::uint64_t vertices, std::uint64_t triangles) {
  // A vertex where three walls meet has three fans. A quarter of all vertices is a high estimate.
  const std::uint64_t fans = vertices + vertices / 2;
  const std::uint64_t kept = fans * (sizeof(std::uint32_t) + sizeof(Wall) + sizeof(std::uint64_t)) +
                             Rings::bytes(fans) + 3 * triangles * sizeof(Spoke) +
                             vertices * sizeof(std::uint32_t);
  return kept + 3 * triangles * sizeof(Spoke) + fans * sizeof(Wall);  // while they are gathered
}

}  // namespace isomesh::mesh
