#include "server/volume/sample_order.h"

#include <algorithm>
#include <cassert>
#include <cstdlib>
#include <utility>
#include <vector>

namespace isomesh::volume {
namespace {

constexpr std::size_t kMostSliceBytes = std::size_t{64} << 20;
// Samples along each side of a tile, which stays in the first cache.
constexpr std::size_t kTile = 32;

// An axis whose samples are still to be reversed, or not.
struct Axis {
  std::size_t number = 0;  // of the present axes
  std::size_t size = 0;
  bool is_reversed = false;

  std::size_t place(std::size_t at) const { return is_reversed ? size - 1 - at : at; }
};

template <class Sample>
void copy_reversed(const Sample* from, std::size_t count, Sample* to) {
  for (std::size_t at = 0; at < count; ++at) to[at] = from[count - 1 - at];
}

// Exchanges the axes of a matrix whose elements are `unit` samples, in place.
template <class Sample>
void exchange_in_place(Sample* samples, std::size_t unit, const Axis& fast, const Axis& slow) {
  const auto source_of = [&](std::size_t place) {
    return fast.place(place / slow.size) + slow.place(place % slow.size) * fast.size;
  };
  std::vector<bool> is_done(fast.size * slow.size);
  std::vector<Sample> first(unit);
  for (std::size_t start = 0; start < is_done.size(); ++start) {
    if (is_done[start]) continue;
    std::copy_n(samples + start * unit, unit, first.begin());
    std::size_t place = start;
    for (;;) {
      is_done[place] = true;
      const std::size_t source = source_of(place);
      if (source == start) break;
      std::copy_n(samples + source * unit, unit, samples + place * unit);
      place = source;
    }
    std::copy_n(first.begin(), unit, samples + place * unit);
  }
}

// Exchanges the axes of a slice, from one place to another. Tiles go through a small copy, because
// rows of 2^n samples all compete for a few places in the cache.
template <class Sample>
void exchange(const Sample* from, const Axis& fast, const Axis& slow, Sample* to) {
  std::array<std::array<Sample, kTile>, kTile> tile;
  for (std::size_t far = 0; far < slow.size; far += kTile) {
    const std::size_t columns = std::min(kTile, slow.size - far);
    for (std::size_t near = 0; near < fast.size; near += kTile) {
      const std::size_t rows = std::min(kTile, fast.size - near);
      const std::size_t first = fast.is_reversed ? fast.size - near - rows : near;
      for (std::size_t column = 0; column < columns; ++column) {
        const Sample* const source = from + slow.place(far + column) * fast.size + first;
        for (std::size_t row = 0; row < rows; ++row) tile[row][column] = source[row];
      }
      for (std::size_t row = 0; row < rows; ++row) {
        const std::size_t of_tile = fast.is_reversed ? rows - 1 - row : row;
        std::copy_n(tile[of_tile].begin(), columns, to + (near + row) * slow.size + far);
      }
    }
  }
}

template <class Sample>
class Turn {
 public:
  Turn(std::span<std::byte> samples, const std::array<std::uint32_t, 3>& dims,
       const AxisOrder& order)
      : samples_(reinterpret_cast<Sample*>(samples.data())) {
    for (std::size_t axis = 0; axis < axes_.size(); ++axis) axes_[axis] = {axis, dims[axis], false};
    for (const int axis : order) {
      axes_[static_cast<std::size_t>(std::abs(axis) - 1)].is_reversed = axis < 0;
    }
    assert(samples.size() >= axes_[0].size * axes_[1].size * axes_[2].size * sizeof(Sample));
  }

  void run(const AxisOrder& order) {
    for (std::size_t place = 0; place < 2; ++place) {
      const auto axis = static_cast<std::size_t>(std::abs(order[place]) - 1);
      std::size_t at = place;
      while (axes_[at].number != axis) ++at;
      for (; at > place; --at) at == 1 ? exchange_in_slices() : exchange_rows();
    }
    reverse_rest();
  }

 private:
  void exchange_in_slices() {
    const std::size_t slice = axes_[0].size * axes_[1].size;
    const bool is_small = slice * sizeof(Sample) <= kMostSliceBytes;
    std::vector<Sample> copy(is_small ? slice : 0);
    for (std::size_t at = 0; at < axes_[2].size; ++at) {
      Sample* const samples = samples_ + at * slice;
      if (is_small) {
        exchange(samples, axes_[0], axes_[1], copy.data());
        std::ranges::copy(copy, samples);
      } else {
        exchange_in_place(samples, 1, axes_[0], axes_[1]);
      }
    }
    exchanged(axes_[0], axes_[1]);
  }

  void exchange_rows() {
    exchange_in_place(samples_, axes_[0].size, axes_[1], axes_[2]);
    exchanged(axes_[1], axes_[2]);
  }

  static void exchanged(Axis& one, Axis& other) {
    std::swap(one, other);
    one.is_reversed = other.is_reversed = false;
  }

  // Exchanges each row with that at the other end of the reversed axes.
  void reverse_rest() {
    const auto& [x, y, z] = axes_;
    if (!x.is_reversed && !y.is_reversed && !z.is_reversed) return;
    std::vector<Sample> copy(x.size);
    for (std::size_t k = 0; k < z.size; ++k) {
      for (std::size_t j = 0; j < y.size; ++j) {
        const std::size_t one = k * y.size + j;
        const std::size_t other = z.place(k) * y.size + y.place(j);
        if (one > other) continue;
        exchange_pair(samples_ + one * x.size, samples_ + other * x.size, copy);
      }
    }
  }

  void exchange_pair(Sample* one, Sample* other, std::vector<Sample>& copy) const {
    const std::size_t size = copy.size();
    std::copy_n(one, size, copy.begin());
    if (!axes_[0].is_reversed) {
      std::copy_n(other, one == other ? 0 : size, one);
      std::ranges::copy(copy, other);
    } else {
      if (one != other) copy_reversed(other, size, one);
      copy_reversed(copy.data(), size, other);
    }
  }

  Sample* samples_;
  std::array<Axis, 3> axes_;
};

}  // namespace

void put_in_order(std::span<std::byte> samples, std::size_t bytes_per_sample,
                  const std::array<std::uint32_t, 3>& dims, const AxisOrder& order) {
  if (order == kFilesOrder) return;
  const auto run = [&](auto sample) { Turn<decltype(sample)>(samples, dims, order).run(order); };
  if (bytes_per_sample == 1) run(std::uint8_t{});
  if (bytes_per_sample == 2) run(std::uint16_t{});
  if (bytes_per_sample == 4) run(std::uint32_t{});
  if (bytes_per_sample == 8) run(std::uint64_t{});
}

}  // namespace isomesh::volume
