// Triangles without area, which joined crossings and smoothing make; private to the kernels.
#pragma once

#include <cstddef>
#include <utility>

#include "server/mesh/smooth/layer_steps.h"

namespace isomesh::mesh {

// Lists the corners of triangles without area between the layer and the next. The caller lists
// those on both sides of a layer before it puts any back.
void list_flat(std::ptrdiff_t layer, const SmoothedLayers& layers);

// Puts the layer's listed vertices back, and sums the displacements anew if there are any.
// `extracted` holds its extracted positions.
void put_back(const Vec3* extracted, std::ptrdiff_t layer, const SmoothedLayers& layers);

// Measures the layer again if vertices that its triangles name have been put back, or nudged,
// since.
void measure_again(std::ptrdiff_t layer, bool SmoothedLayer::*was_moved,
                   const SmoothedLayers& layers);

// Moves corners of triangles between the layer and the next that have no area still. One corner
// that is put back can come to lie in line with two others that are not, and so can the means of
// joined crossings. Once for each layer, in their order, when those up to the second next have been
// put back, and those up to the next measured again. Each move is about a rounding long: 2^-22 of
// the largest coordinate beside it.
void nudge_flat(std::ptrdiff_t layer, const SmoothedLayers& layers);

// Nudges all layers of a mesh that is not being smoothed, and measures it. Throws Error kCancelled.
Extent open_flat(const Context& context, Mesh& mesh);

// Nudges as the layers come, after all their steps, and measures again.
class FlatTriangles {
 public:
  explicit FlatTriangles(SmoothedLayers layers) : layers_(std::move(layers)) {}

  // As LayerSteps::moved() says.
  void go_on(std::ptrdiff_t moved);
  // The layers before this never move again.
  std::ptrdiff_t ended() const { return nudged_; }

 private:
  const SmoothedLayers layers_;
  std::ptrdiff_t nudged_ = 0;
  std::ptrdiff_t ended_ = 0;
};

}  // namespace isomesh::mesh
