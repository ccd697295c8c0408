// A volume in each order in which a file can store its axes.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "tests/support/shapes.h"

namespace isomesh::test {

// The axes of a volume that a file's first, second and third index run along, and those that it
// runs along backwards.
struct Storage {
  std::array<std::size_t, 3> axes = {0, 1, 2};
  std::array<bool, 3> is_reversed = {};
};

inline std::vector<Storage> all_storages() {
  std::vector<Storage> storages;
  std::array<std::size_t, 3> axes = {0, 1, 2};
  do {
    for (unsigned signs = 0; signs < 8; ++signs) {
      storages.push_back({axes, {(signs & 1) != 0, (signs & 2) != 0, (signs & 4) != 0}});
    }
  } while (std::ranges::next_permutation(axes).found);
  return storages;
}

// The same samples at the same places, in another order.
template <class T>
SampleVolume<T> stored_as(const SampleVolume<T>& volume, const Storage& storage) {
  const std::array<std::uint32_t, 3> dims = {volume.dims.x, volume.dims.y, volume.dims.z};
  SampleVolume<T> stored;
  std::array<std::uint32_t, 3> sizes = {};
  stored.geometry.origin = volume.geometry.origin;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t from = storage.axes[axis];
    const double sign = storage.is_reversed[axis] ? -1 : 1;
    sizes[axis] = dims[from];
    stored.geometry.spacing[axis] = volume.geometry.spacing[from];
    for (std::size_t row = 0; row < 3; ++row) {
      const double part = volume.geometry.direction[row * 3 + from];
      stored.geometry.direction[row * 3 + axis] = sign * part;
      if (!storage.is_reversed[axis]) continue;
      stored.geometry.origin[row] += part * volume.geometry.spacing[from] * (dims[from] - 1);
    }
  }
  stored.dims = {sizes[0], sizes[1], sizes[2]};
  std::array<std::uint32_t, 3> index = {};
  for (index[2] = 0; index[2] < sizes[2]; ++index[2]) {
    for (index[1] = 0; index[1] < sizes[1]; ++index[1]) {
      for (index[0] = 0; index[0] < sizes[0]; ++index[0]) {
        std::array<std::uint32_t, 3> from = {};
        for (std::size_t axis = 0; axis < 3; ++axis) {
          from[storage.axes[axis]] =
              storage.is_reversed[axis] ? sizes[axis] - 1 - index[axis] : index[axis];
        }
        stored.samples.push_back(
            volume.samples[(std::size_t{from[2]} * dims[1] + from[1]) * dims[0] + from[0]]);
      }
    }
  }
  return stored;
}

}  // namespace isomesh::test
