// Several steps of smoothing in one walk through layers; private to the kernels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "server/mesh/measure/extent-inl.h"
#include "server/mesh/mesh.h"
#include "server/mesh/points.h"
#include "server/mesh/smooth/smooth.h"

namespace isomesh::mesh {

// Layers [begin, end); signed, because layers before the first occur.
struct LayerRange {
  std::ptrdiff_t begin = 0;
  std::ptrdiff_t end = 0;

  bool contains(std::ptrdiff_t layer) const { return layer >= begin && layer < end; }
};

// A layer of a surface. Its triangles number the vertices of their mesh; those of the next layer,
// which may lie in another mesh, follow the layer's own.
struct LayerView {
  Mesh* mesh = nullptr;
  std::size_t layer = 0;            // of that mesh
  Vec3* positions = nullptr;        // of the layer's vertices
  const Vec3* extracted = nullptr;  // null if the positions are those until the last step

  std::uint64_t first() const { return mesh->layer_vertices[layer]; }
  std::uint64_t end() const { return mesh->layer_vertices[layer + 1]; }
  std::size_t vertices() const { return end() - first(); }
  std::span<const Triangle> triangles() const { return mesh->triangles_of(layer, layer + 1); }
};

// The goal in single precision. If that is farther than `limit` from the origin, the point at this
// distance on the way; each coordinate is rounded towards the origin, so it is never beyond.
Vec3 rounded_within(const Vec3& origin, const Point& goal, double limit);

// Sums over the vertices of a layer, or of several.
struct LayerDisplacement {
  double sum = 0;
  double largest = 0;

  void add(const Vec3& extracted, const Vec3& moved);
};

// The effect of all steps on a layer.
struct SmoothedLayer {
  LayerExtent before;
  LayerExtent after;
  LayerDisplacement displacement;
  // Vertices, counted from the layer's first, that go back to where they were extracted, because a
  // triangle of theirs has no area after the last step: means put all corners of a component of a
  // sample or two on one point. Some several times.
  std::vector<std::uint32_t> flat;
  bool was_put_back = false;
  bool was_nudged = false;
};

// The layers of a surface, and the place for what is found of each.
struct SmoothedLayers {
  std::function<LayerView(std::ptrdiff_t)> view;
  std::span<SmoothedLayer> results;

  std::ptrdiff_t count() const { return static_cast<std::ptrdiff_t>(results.size()); }
  SmoothedLayer& result(std::ptrdiff_t layer) const {
    return results[static_cast<std::size_t>(layer)];
  }
  // Adds the layer's triangles, which name vertices of the next layer, too.
  void add_triangles(std::ptrdiff_t layer, LayerExtent SmoothedLayer::*extent) const;
  // The sums of all layers, of so many vertices.
  SmoothingEffect effect(std::uint64_t vertices) const;
};

// Steps that are made together: [first, end) of the options'.
struct Round {
  const SmoothOptions& options;
  std::size_t first = 0;
  std::size_t end = 0;
  std::size_t largest_layer = 0;  // at least the vertices of each

  std::size_t steps() const { return end - first; }
  // The first measures the surface before; the last measures it afterwards, and puts vertices back.
  bool is_first() const { return first == 0; }
  bool is_last() const { return end == options.steps.size(); }
};

// The layers beside a run on which its own depend after the last step: a vertex that is put back
// changes the triangles of the layer before, and corners of the layer's and of the next one's
// triangles tell what is put back.
inline constexpr std::size_t kBelowRun = 1;
inline constexpr std::size_t kAboveRun = 2;

// Moves the vertices of a run of layers by all steps of a round, as the layers come, and those
// around the run as far as they matter to it. In the last round, vertices of triangles without area
// are put back. Results do not depend on where a run is cut.
class LayerSteps {
 public:
  // `layers` are those of `around(run)`. The objects that these refer to must outlive it.
  LayerSteps(const Round& round, const LayerRange& run, SmoothedLayers layers);
  ~LayerSteps();

  // A run of that many layers of the surface, and what it reads on both sides, which it moves too.
  static LayerRange around(const Round& round, const LayerRange& run, std::ptrdiff_t layers);

  // Goes on as far as it can when the layers before `available` may be read.
  void go_on(std::ptrdiff_t available);
  // The layers before this have been moved by all steps; those before the last of them have been
  // put back, and those before the last two measured.
  std::ptrdiff_t moved() const;

 private:
  class Sweep;
  std::unique_ptr<Sweep> sweep_;
};

// An upper bound of the memory of a round of this many steps, in bytes for each vertex of the
// largest layer, if no vertex has more than kUsualNeighbors neighbours.
std::uint64_t step_bytes_per_vertex(std::size_t steps);

// More neighbours are possible, but slower.
inline constexpr std::size_t kUsualNeighbors = 8;

}  // namespace isomesh::mesh
