#include "server/mesh/smooth/flat_triangles.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>
#include <utility>
#include <vector>

#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

using Corners = std::array<Vec3*, 3>;

bool is_without_area(const Corners& corners) {
  return has_no_area(*corners[0], *corners[1], *corners[2]);
}

// A layer and the next, whose vertices its triangles name.
struct TwoLayers {
  TwoLayers(std::ptrdiff_t layer, const SmoothedLayers& layers)
      : low(layers.view(layer)),
        high(layer + 1 < layers.count() ? layers.view(layer + 1) : LayerView()) {}

  bool is_high(std::uint32_t vertex) const { return vertex >= low.end(); }
  std::size_t index(std::uint32_t vertex) const {
    return vertex - (is_high(vertex) ? low.end() : low.first());
  }
  Vec3* at(std::uint32_t vertex) const {
    return (is_high(vertex) ? high : low).positions + index(vertex);
  }
  Corners corners(const Triangle& triangle) const {
    return {at(triangle[0]), at(triangle[1]), at(triangle[2])};
  }

  LayerView low;
  LayerView high;
};

// The triangles around a vertex.
struct Surroundings {
  std::vector<Corners> triangles;
  std::int64_t next_minus_previous = 0;  // not 0 on the boundary of a manifold
};

// The corners of a layer's flat triangles, with all triangles around them.
class FlatCorners {
 public:
  FlatCorners(std::ptrdiff_t layer, const SmoothedLayers& layers) : layers_(layers) {
    const TwoLayers two(layer, layers);
    for (const Triangle& triangle : two.low.triangles()) {
      const Corners corners = two.corners(triangle);
      if (!is_without_area(corners)) continue;
      for (std::size_t n = 0; n < 3; ++n) {
        const std::ptrdiff_t of_corner = two.is_high(triangle[n]) ? layer + 1 : layer;
        flat_.push_back({corners[n], two.index(triangle[n]), of_corner});
        fans_.try_emplace(corners[n]);
      }
    }
    if (fans_.empty()) return;
    for (std::ptrdiff_t n = std::max<std::ptrdiff_t>(0, layer - 1);
         n <= std::min(layer + 1, layers.count() - 1); ++n) {
      add_triangles(TwoLayers(n, layers));
    }
  }

  // Moves a corner of each triangle that is flat still: a free one if there is any, else one on a
  // curve or the boundary. The latter stay if the surface is closed, so caps stay flat.
  void open() {
    for (std::size_t first = 0; first < flat_.size(); first += 3) {
      if (!is_without_area({flat_[first].at, flat_[first + 1].at, flat_[first + 2].at})) continue;
      std::array<Corner, 3> corners = {flat_[first], flat_[first + 1], flat_[first + 2]};
      std::ranges::stable_sort(corners, {}, [&](const Corner& c) { return rank(c); });
      for (const Corner& corner : corners) {
        if (rank(corner) == kFixed || !nudge(*corner.at)) continue;
        layers_.result(corner.layer).was_nudged = true;
        break;
      }
    }
  }

 private:
  enum Rank : std::uint8_t { kFree, kOnCurve, kOnBoundary, kFixed };

  struct Corner {
    Vec3* at = nullptr;
    std::size_t index = 0;  // in its layer
    std::ptrdiff_t layer = 0;
  };

  void add_triangles(const TwoLayers& two) {
    for (const Triangle& triangle : two.low.triangles()) {
      const Corners corners = two.corners(triangle);
      for (std::size_t n = 0; n < 3; ++n) {
        const auto found = fans_.find(corners[n]);
        if (found == fans_.end()) continue;
        found->second.triangles.push_back(corners);
        found->second.next_minus_previous +=
            std::int64_t{triangle[(n + 1) % 3]} - triangle[(n + 2) % 3];
      }
    }
  }

  Rank rank(const Corner& corner) const {
    const LayerView own = layers_.view(corner.layer);
    const std::size_t number = own.first() + corner.index;
    if (own.mesh->is_on_border(number)) return kFixed;
    if (own.mesh->is_on_line(number)) return kOnCurve;
    return fans_.at(corner.at).next_minus_previous == 0 ? kFree : kOnBoundary;
  }

  // Moves a vertex by about the rounding of its position, such that its triangles have areas.
  // Returns false if there is no such move.
  bool nudge(Vec3& vertex) const {
    const std::vector<Corners>& around = fans_.at(&vertex).triangles;
    float largest = 0;
    for (const Corners& corners : around) {
      for (const Vec3* each : corners) {
        for (const float at : *each) largest = std::max(largest, std::abs(at));
      }
    }
    const Vec3 before = vertex;
    for (const float step : {largest * 0x1p-22F, -largest * 0x1p-22F}) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        vertex[axis] = before[axis] + step;
        if (std::ranges::none_of(around, is_without_area)) return true;
        vertex = before;
      }
    }
    return false;
  }

  const SmoothedLayers& layers_;
  std::vector<Corner> flat_;  // three for each flat triangle
  std::unordered_map<const Vec3*, Surroundings> fans_;
};

}  // namespace

void list_flat(std::ptrdiff_t layer, const SmoothedLayers& layers) {
  const TwoLayers two(layer, layers);
  for (const Triangle& triangle : two.low.triangles()) {
    if (!is_without_area(two.corners(triangle))) continue;
    for (const std::uint32_t vertex : triangle) {
      layers.result(two.is_high(vertex) ? layer + 1 : layer)
          .flat.push_back(static_cast<std::uint32_t>(two.index(vertex)));
    }
  }
}

void put_back(const Vec3* extracted, std::ptrdiff_t layer, const SmoothedLayers& layers) {
  SmoothedLayer& result = layers.result(layer);
  if (result.flat.empty()) return;
  const LayerView view = layers.view(layer);
  for (const std::uint32_t vertex : result.flat) view.positions[vertex] = extracted[vertex];
  result.flat = {};
  result.was_put_back = true;
  result.displacement = {};
  for (std::size_t v = 0; v < view.vertices(); ++v) {
    result.displacement.add(extracted[v], view.positions[v]);
  }
}

void measure_again(std::ptrdiff_t layer, bool SmoothedLayer::*was_moved,
                   const SmoothedLayers& layers) {
  SmoothedLayer& result = layers.result(layer);
  const bool has_next = layer + 1 < layers.count();
  if (!(result.*was_moved) && !(has_next && layers.result(layer + 1).*was_moved)) return;
  result.after = {};
  const LayerView view = layers.view(layer);
  for (std::size_t v = 0; v < view.vertices(); ++v)
    result.after.add_vertex(load(view.positions[v]));
  layers.add_triangles(layer, &SmoothedLayer::after);
}

void nudge_flat(std::ptrdiff_t layer, const SmoothedLayers& layers) {
  if (layers.result(layer).after.has_flat()) FlatCorners(layer, layers).open();
}

Extent open_flat(const Context& context, Mesh& mesh) {
  std::vector<SmoothedLayer> results(mesh.layers());
  const auto view = [&](std::ptrdiff_t layer) -> LayerView {
    const auto index = static_cast<std::size_t>(layer);
    return {&mesh, index, mesh.positions.data() + mesh.layer_vertices[index]};
  };
  const SmoothedLayers layers = {view, results};
  constexpr std::size_t kLayersPerTask = 4;
  const auto measure = [&](std::size_t layer) {
    const LayerView own = view(static_cast<std::ptrdiff_t>(layer));
    for (std::size_t v = 0; v < own.vertices(); ++v) {
      results[layer].after.add_vertex(load(own.positions[v]));
    }
    layers.add_triangles(static_cast<std::ptrdiff_t>(layer), &SmoothedLayer::after);
  };
  for_each(context, results.size(), measure, kLayersPerTask);
  FlatTriangles(layers).go_on(layers.count());
  return layers.effect(mesh.positions.size()).after;
}

void FlatTriangles::go_on(std::ptrdiff_t moved) {
  const std::ptrdiff_t count = layers_.count();
  // How many have ended that still wait for so many further layers.
  const auto without = [&](std::ptrdiff_t waiting) {
    return moved == count ? count : std::max<std::ptrdiff_t>(0, moved - waiting);
  };
  for (; nudged_ < without(3); ++nudged_) nudge_flat(nudged_, layers_);
  for (; ended_ < without(4); ++ended_) {
    measure_again(ended_, &SmoothedLayer::was_nudged, layers_);
  }
}

}  // namespace isomesh::mesh
