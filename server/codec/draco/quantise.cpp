#include "server/codec/draco/quantise.h"

#include <algorithm>

namespace isomesh::codec::edgebreaker {
namespace {

// Four lanes: GCC and Clang compile them for every processor.
using Floats = float __attribute__((vector_size(16)));
using Ints = std::int32_t __attribute__((vector_size(16)));

}  // namespace

void Extent::cover(const Extent& other) {
  least = std::min(least, other.least);
  greatest = std::max(greatest, other.greatest);
}

bool quantise(std::span<const mesh::Vec3> positions, const Grid& grid, GridPoint* points,
              Extent& extent) {
  const auto steps = static_cast<float>((1 << grid.bits) - 1);
  const float scale = steps / grid.side;
  const Floats low = {grid.low[0], grid.low[1], grid.low[2], grid.low[0]};
  const Ints nowhere = {0, 0, 0, 0};
  Ints outside = nowhere;
  Ints least = nowhere + static_cast<std::int32_t>(steps);
  Ints greatest = nowhere;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const auto& [x, y, z] = positions[i];
    const Floats scaled = (Floats{x, y, z, x} - low) * scale + 0.5F;
    // Also false for NaN. Conversion rounds nonnegative values down.
    const Ints inside = (scaled >= 0) & (scaled < steps + 1);
    outside |= ~inside;
    const Ints on_grid = __builtin_convertvector(inside ? scaled : Floats{}, Ints);
    least = on_grid < least ? on_grid : least;
    greatest = on_grid > greatest ? on_grid : greatest;
    points[i] = {static_cast<std::uint16_t>(on_grid[0]), static_cast<std::uint16_t>(on_grid[1]),
                 static_cast<std::uint16_t>(on_grid[2]), 0};
  }
  extent = {std::min({least[0], least[1], least[2]}),
            std::max({greatest[0], greatest[1], greatest[2]})};
  return (outside[0] | outside[1] | outside[2]) == 0;
}

}  // namespace isomesh::codec::edgebreaker
