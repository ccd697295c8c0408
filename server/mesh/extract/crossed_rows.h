// Where a surface is, before it is written.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "server/mesh/lattice/lattice.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// The box of the samples of a layer that own crossed edges. Row by row, so that it is as narrow on
// a lattice that is turned.
struct CrossedRows {
  static constexpr double kFar = std::numeric_limits<double>::infinity();

  std::array<double, 3> low = {kFar, kFar, kFar};
  std::array<double, 3> high = {-kFar, -kFar, -kFar};

  bool is_empty() const { return low[0] > high[0]; }
  void add(const CrossedRows& other) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], other.low[axis]);
      high[axis] = std::max(high[axis], other.high[axis]);
    }
  }
  // The samples from `first` to `last` of a row, in the lattice's own numbers.
  void add_row(const LatticeToSpace& to_space, std::int64_t first, std::int64_t last,
               std::int64_t y, std::int64_t z) {
    for (const std::int64_t x : {first, last}) {
      std::array<double, 3> at = {};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        at[axis] = to_space.origin[axis] + to_space.step_x[axis] * static_cast<double>(x) +
                   to_space.step_y[axis] * static_cast<double>(y) +
                   to_space.step_z[axis] * static_cast<double>(z);
      }
      add({at, at});
    }
  }
};

// The samples of a row that own crossed edges, as they are found word by word.
class OwnersOfRow {
 public:
  void add(std::size_t word, std::uint64_t owners) {
    if (owners == 0) return;
    const auto from = static_cast<std::int64_t>(word * 64);
    if (last_ < 0) first_ = from + std::countr_zero(owners);
    last_ = from + std::bit_width(owners) - 1;
  }
  // Phantoms of the marching are numbered too.
  template <class Marched>
  void add_to(const Marched& marched, std::uint32_t y, std::uint32_t z, CrossedRows& rows) const {
    if (last_ < 0) return;
    const std::int64_t margin = marched.margin;
    rows.add_row(marched.to_space, first_ - margin, last_ - margin, y - margin, z - margin);
  }

 private:
  std::int64_t first_ = 0;
  std::int64_t last_ = -1;
};

// Mesh::reach of a surface with crossings in such rows.
Reach reach_of(std::span<const CrossedRows> layers, const LatticeToSpace& to_space);

}  // namespace isomesh::mesh
