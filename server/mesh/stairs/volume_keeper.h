// Puts the volume back that walls lack; private to this folder.
#pragma once

#include <span>
#include <vector>

#include "server/mesh/stairs/mobility.h"
#include "server/mesh/stairs/wall_shape.h"

namespace isomesh::mesh {

// The missing volume is divided by the area that it may be spread over, and averaged within the
// wall. The result is an offset along the wall's normal. Averaging is the adjoint of spreading, so
// the offsets times the areas add up to the missing volume.
class VolumeKeeper {
 public:
  // `missing`: by fan, what the wall's back lacks at the start, in the shape's unit. `series`: how
  // far it is spread. `shape`, `mobility`, `series` and `context` have to outlive this.
  VolumeKeeper(const WallShape& shape, const Mobility& mobility, Buffer<float> missing,
               const std::vector<float>& series, const Context& context);

  // From now on curves stay.
  void hold_curves();

  // Moves the walls once. Throws Error kCancelled.
  void restore(WallShape& shape) const;

 private:
  Buffer<float> all_fans() const;  // of indeterminate values
  void find_areas();
  bool may_move(std::size_t vertex) const;
  Buffer<float> averaged(Buffer<float> values, std::span<const float> series) const;
  Buffer<float> spread(Buffer<float> values, std::span<const float> series) const;
  Buffer<float> offsets(const WallShape& shape, Buffer<Lanes>& normals) const;
  Lanes way_of_curve(const WallShape& shape, std::size_t vertex, const Buffer<float>& offsets,
                     const Buffer<Lanes>& normals) const;

  const WallShape& shape_;
  const Mobility& mobility_;
  const std::vector<float>& series_;
  const Context& context_;
  bool holds_curves_ = false;
  std::vector<std::size_t> blocks_;  // of fans, for in_waves
  Buffer<float> kept_;               // by fan: of itself in the mean
  Buffer<float> shares_;             // by fan: of a neighbour in the mean
  Buffer<float> missing_;            // by fan, at the start, a little spread
  Buffer<float> areas_;              // by fan, at the start
  Buffer<Lanes> normals_;            // the same; the length is twice the area
  Buffer<float> room_;               // those that may take volume, spread
};

}  // namespace isomesh::mesh
