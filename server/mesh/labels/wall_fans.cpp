#include "server/mesh/labels/wall_fans.h"

#include <algorithm>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "server/mesh/parallel.h"

namespace isomesh::mesh {

// A triangle at a vertex: its wall, and its other two corners, counter-clockwise.
struct WallFans::Corner {
  Wall wall;
  std::uint32_t next = 0;
  std::uint32_t previous = 0;
};

// Fans of the vertices of one layer.
struct WallFans::Layer {
  struct Fan {
    std::uint64_t vertex = 0;
    Wall wall;
    Kind kind = Kind::kClosed;
    std::uint32_t size = 0;  // of its part of the ring
  };
  std::vector<Fan> fans;
  std::vector<std::uint32_t> ring;
};

WallFans::Kind WallFans::append_ring(std::span<const Corner> fan,
                                     std::vector<std::uint32_t>& ring) {
  const std::size_t begin = ring.size();
  const auto is_complete = [&] { return ring.size() == begin + fan.size(); };
  // From triangle to triangle, until all were seen, none follows, or that is the first again.
  const auto walk = [&](auto first) {
    auto at = first;
    auto last = at;
    do {
      ring.push_back(at->next);
      last = at;
      at = std::ranges::find(fan, at->previous, &Corner::next);
    } while (at != fan.end() && at != first && !is_complete());
    return std::pair(last, at);
  };
  if (walk(fan.begin()).second == fan.begin() && is_complete()) return Kind::kClosed;
  ring.resize(begin);
  const auto first = std::ranges::find_if(fan, [&](const Corner& corner) {
    return std::ranges::find(fan, corner.next, &Corner::previous) == fan.end();
  });
  if (first != fan.end()) {
    const auto [last, end] = walk(first);
    if (end == fan.end() && is_complete()) {
      ring.push_back(last->previous);
      return Kind::kOpen;
    }
    ring.resize(begin);
  }
  for (const Corner& corner : fan) ring.insert(ring.end(), {corner.next, corner.previous});
  return Kind::kLoose;
}

WallFans::Layer WallFans::layer_of(const SeparatingSurface& surface,
                                   std::span<const std::uint8_t> faces, std::size_t layer) {
  const Mesh& mesh = surface.mesh;
  const std::uint64_t first = mesh.layer_vertices[layer];
  const std::uint64_t vertices = mesh.layer_vertices[layer + 1] - first;
  const std::uint64_t low = mesh.layer_triangles[layer == 0 ? 0 : layer - 1];
  const std::uint64_t high = mesh.layer_triangles[layer + 1];
  const auto visit_corners = [&](const auto& visit) {
    for (std::uint64_t t = low; t < high; ++t) {
      for (std::uint32_t i = 0; i < 3; ++i) {
        const std::uint64_t v = mesh.triangles[t][i] - first;
        if (v < vertices) visit(v, static_cast<std::uint32_t>(t - low) * 3 + i);
      }
    }
  };
  // By vertex: first where its corners begin, and then where they end.
  std::vector<std::uint32_t> ends(vertices + 1, 0);
  visit_corners([&](std::uint64_t v, std::uint32_t) { ++ends[v + 1]; });
  for (std::size_t v = 0; v < vertices; ++v) ends[v + 1] += ends[v];
  std::vector<std::uint32_t> sorted(ends[vertices]);
  visit_corners([&](std::uint64_t v, std::uint32_t corner) { sorted[ends[v]++] = corner; });

  Layer result;
  result.fans.reserve(vertices + vertices / 4);
  result.ring.reserve(sorted.size() + sorted.size() / 8);
  std::vector<Corner> corners;
  std::uint32_t begin = 0;
  for (std::size_t v = 0; v < vertices; begin = ends[v++]) {
    corners.clear();
    for (std::uint32_t n = begin; n < ends[v]; ++n) {
      const std::uint64_t t = low + sorted[n] / 3;
      const Triangle& triangle = mesh.triangles[t];
      const auto& [a, b, c] = triangle;
      const std::uint32_t i = sorted[n] % 3;
      const bool is_cap = !faces.empty() && (faces[a] & faces[b] & faces[c]) != 0;
      corners.push_back({{surface.sides[t], is_cap}, triangle[(i + 1) % 3], triangle[(i + 2) % 3]});
    }
    const bool is_one_wall = std::ranges::all_of(
        corners, [&](const Corner& corner) { return corner.wall == corners[0].wall; });
    if (!is_one_wall) std::ranges::stable_sort(corners, {}, &Corner::wall);
    for (auto at = corners.begin(), end = at; at != corners.end(); at = end) {
      end = std::find_if(at, corners.end(),
                         [&](const Corner& corner) { return corner.wall != at->wall; });
      const std::size_t before = result.ring.size();
      const Kind kind = append_ring({at, end}, result.ring);
      const auto size = static_cast<std::uint32_t>(result.ring.size() - before);
      result.fans.push_back({first + v, at->wall, kind, size});
    }
  }
  return result;
}

WallFans::WallFans(const SeparatingSurface& surface, std::span<const std::uint8_t> faces,
                   const Context& context) {
  const Mesh& mesh = surface.mesh;
  const std::size_t layers = mesh.layers();
  std::vector<Layer> all(layers);
  parallel_for(context, layers,
               [&](std::size_t layer) { all[layer] = layer_of(surface, faces, layer); });

  std::vector<std::uint64_t> fans_before(layers + 1, 0);
  std::vector<std::uint64_t> ring_before(layers + 1, 0);
  for (std::size_t layer = 0; layer < layers; ++layer) {
    fans_before[layer + 1] = fans_before[layer] + all[layer].fans.size();
    ring_before[layer + 1] = ring_before[layer] + all[layer].ring.size();
  }
  if (fans_before[layers] > std::numeric_limits<std::int32_t>::max()) {
    throw Error(ErrorCode::kTooLarge,
                "the walls between the labels have too many vertices: 31 "
                "bits cannot number what smoothing needs for each");
  }
  first_.resize_for_overwrite(mesh.positions.size() + 1);
  vertex_.resize_for_overwrite(fans_before[layers]);
  walls_.resize_for_overwrite(fans_before[layers]);
  kinds_.resize_for_overwrite(fans_before[layers]);
  ring_begin_.resize_for_overwrite(fans_before[layers] + 1);
  ring_.resize_for_overwrite(ring_before[layers]);
  first_[mesh.positions.size()] = static_cast<std::uint32_t>(fans_before[layers]);
  ring_begin_[fans_before[layers]] = ring_before[layers];
  parallel_for(context, layers, [&](std::size_t layer) {
    Layer& here = all[layer];
    std::ranges::copy(here.ring, ring_.begin() + ring_before[layer]);
    std::uint64_t fan = fans_before[layer];
    std::uint64_t begin = ring_before[layer];
    std::uint64_t next = mesh.layer_vertices[layer];
    for (const Layer::Fan& each : here.fans) {
      while (next <= each.vertex) first_[next++] = static_cast<std::uint32_t>(fan);
      vertex_[fan] = static_cast<std::uint32_t>(each.vertex);
      walls_[fan] = each.wall;
      kinds_[fan] = each.kind;
      ring_begin_[fan++] = std::exchange(begin, begin + each.size);
    }
    while (next < mesh.layer_vertices[layer + 1]) first_[next++] = static_cast<std::uint32_t>(fan);
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
  neighbors_ = NeighborLists(size(), context, [&](std::size_t fan, auto& list) {
    list.assign(ring_.begin() + ring_begin_[fan], ring_.begin() + ring_begin_[fan + 1]);
    if (kinds_[fan] == Kind::kLoose) {
      std::ranges::sort(list);
      list.erase(std::unique(list.begin(), list.end()), list.end());
    }
    for (std::uint32_t& each : list) {
      const bool is_alone = first_[each + 1] - first_[each] == 1;
      each = is_alone ? first_[each] : find(each, walls_[fan]);
    }
  });
}

std::uint64_t WallFans::bytes(std::uint64_t vertices, std::uint64_t triangles) {
  // A vertex where three walls meet has three fans. A quarter of all vertices is a high estimate.
  // An open ring has one corner more than triangles.
  const std::uint64_t fans = vertices + vertices / 2;
  const std::uint64_t ring = (3 * triangles + fans) * sizeof(std::uint32_t);
  const std::uint64_t kept =
      fans * (sizeof(std::uint32_t) + sizeof(Wall) + sizeof(Kind) + sizeof(std::uint64_t)) +
      vertices * sizeof(std::uint32_t) + ring + NeighborLists::bytes(fans);
  return kept + fans * sizeof(Layer::Fan) + ring;  // while they are gathered
}

}  // namespace isomesh::mesh
