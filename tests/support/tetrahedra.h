// The paper's Table 1, implemented independently of the kernels.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "proto/types.h"
#include "server/mesh/lattice/lattice.h"

namespace isomesh::test {

using Sample = std::array<std::uint32_t, 3>;

struct Tetrahedron {
  std::array<Sample, 4> samples;
  std::uint32_t layer = 0;  // k of its cell
};

// Visits the tetrahedra of all cells. In scheme 5, cells of odd i+j+k are mirrored, by the volume's
// own indices, which are smaller by `margin`.
template <class Visit>
void for_each_tetrahedron(const mesh::Dims& dims, Scheme scheme, std::uint32_t margin,
                          Visit visit) {
  using Corners = std::array<unsigned, 4>;
  static constexpr Sample kCorners[8] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                         {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
  static constexpr Corners kSix[6] = {{0, 2, 3, 6}, {0, 1, 2, 6}, {0, 1, 5, 6},
                                      {0, 3, 6, 7}, {0, 4, 6, 7}, {0, 4, 5, 6}};
  static constexpr Corners kFive[5] = {
      {0, 2, 3, 7}, {0, 1, 2, 5}, {0, 4, 5, 7}, {2, 5, 6, 7}, {0, 2, 5, 7}};
  const bool five = scheme == Scheme::kFive;
  const mesh::Dims inner = {dims.x - 2 * margin, dims.y - 2 * margin, dims.z - 2 * margin};
  if (!inner.has_cells()) return;
  for (std::uint32_t k = 0; k + 1 < dims.z; ++k) {
    for (std::uint32_t j = 0; j + 1 < dims.y; ++j) {
      for (std::uint32_t i = 0; i + 1 < dims.x; ++i) {
        const bool mirrored = five && (i + j + k + 3 * margin) % 2 == 1;
        for (const Corners& corners : five ? std::span<const Corners>(kFive) : kSix) {
          Tetrahedron tetrahedron{{}, k};
          for (std::size_t n = 0; n < 4; ++n) {
            const Sample& c = kCorners[corners[n]];
            tetrahedron.samples[n] = {i + (mirrored ? 1 - c[0] : c[0]), j + c[1], k + c[2]};
          }
          visit(tetrahedron);
        }
      }
    }
  }
}

}  // namespace isomesh::test
