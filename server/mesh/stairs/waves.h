// Steps in which a value depends on its neighbours', done while those are in a cache; private to
// this folder.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

#include "server/mesh/context.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh {

// Calls step(j, begin, end) for j in [1, steps] and each of the blocks between two consecutive
// `bounds`, several at once. Step j of a block comes after step j - 1 of itself and of the two
// beside it, and before step j + 1 of those, so it may write over what step j - 2 left. Throws
// Error kCancelled.
template <class Step>
void in_waves(const Context& context, std::span<const std::size_t> bounds, std::size_t steps,
              const Step& step) {
  const std::size_t blocks = bounds.empty() ? 0 : bounds.size() - 1;
  // Tiles, from which each step leaves a block more at both ends out; then what is left between
  // two.
  const std::size_t tiles = std::max<std::size_t>(1, blocks / (2 * steps + 2));
  const auto cut = [&](std::size_t tile) { return tile * blocks / tiles; };
  const auto run = [&](std::size_t j, std::size_t block) {
    step(j, bounds[block], bounds[block + 1]);
  };
  parallel_for(context, tiles, [&](std::size_t tile) {
    const std::size_t low = cut(tile);
    const std::size_t high = cut(tile + 1);
    for (std::size_t front = low; front < high + steps; ++front) {
      for (std::size_t j = 1; j <= std::min(steps, front - low + 1); ++j) {
        const std::size_t block = front + 1 - j;
        const std::size_t begin = tile == 0 ? 0 : low + j - 1;
        const std::size_t end = tile + 1 == tiles ? blocks : high - (j - 1);
        if (block >= begin && block < end) run(j, block);
      }
    }
  });
  parallel_for(context, tiles - 1, [&](std::size_t tile) {
    const std::size_t middle = cut(tile + 1);
    for (std::size_t j = 2; j <= steps; ++j) {
      for (std::size_t block = middle - (j - 1); block < middle + (j - 1); ++block) run(j, block);
    }
  });
}

}  // namespace isomesh::mesh
