#include "server/volume/sample_order.h"

#include <algorithm>
#include <cassert>
#include <cstdlib>
#include <cstring>
#include <utility>
#include <vector>

#include "base/error.h"
#include "server/volume/unusable.h"

namespace isomesh::volume {
namespace {

constexpr std::size_t kMostSliceBytes = std::size_t{64} << 20;
// Samples along each side of a tile, which stays in the first cache.
constexpr std::size_t kTileSide = 64;

// An axis whose samples are still to be reversed, or not.
struct Side {
  std::size_t number = 0;  // of the present axes
  std::size_t size = 0;
  bool is_reversed = false;

  std::size_t place(std::size_t at) const { return is_reversed ? size - 1 - at : at; }
};

void check(const std::stop_token& stop) {
  if (stop.stop_requested()) throw Error(ErrorCode::kCancelled, "stopped");
}

template <class Sample>
void copy_reversed(const Sample* from, std::size_t count, Sample* to) {
  std::size_t at = 0;
  if constexpr (sizeof(Sample) == 1) {  // eight at once; the compiler finds no vectors for bytes
    for (; at + sizeof(std::uint64_t) <= count; at += sizeof(std::uint64_t)) {
      std::uint64_t eight = 0;
      std::memcpy(&eight, from + count - sizeof(eight) - at, sizeof(eight));
      eight = __builtin_bswap64(eight);
      std::memcpy(to + at, &eight, sizeof(eight));
    }
  }
  for (; at < count; ++at) to[at] = from[count - 1 - at];
}

// Exchanges the axes of a matrix whose elements are `unit` samples, in place.
template <class Sample>
void exchange_in_place(Sample* samples, std::size_t unit, const Side& fast, const Side& slow,
                       const std::stop_token& stop) {
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
      check(stop);
      is_done[place] = true;
      const std::size_t source = source_of(place);
      if (source == start) break;
      std::copy_n(samples + source * unit, unit, samples + place * unit);
      place = source;
    }
    std::copy_n(first.begin(), unit, samples + place * unit);
  }
}

constexpr std::size_t kVectorBytes = 16;  // that every processor has
// Samples along each side of a square block, whose rows are vectors.
template <class Sample>
constexpr std::size_t kSquare = kVectorBytes / sizeof(Sample);
template <class Sample>
struct VectorType {
  using Type [[gnu::vector_size(kVectorBytes)]] = Sample;
};
template <class Sample>
using VectorOf = typename VectorType<Sample>::Type;

// The samples of two vectors in turn: those of the first halves, or of the second.
template <class Sample, std::size_t First, std::size_t... At>
VectorOf<Sample> alternated(VectorOf<Sample> one, VectorOf<Sample> other,
                            std::index_sequence<At...>) {
  return __builtin_shufflevector(
      one, other, (At % 2 == 0 ? First + At / 2 : kSquare<Sample> + First + At / 2)...);
}

// Exchanges the axes of a block: each round shuffles its rows as the halves of a deck of cards.
template <class Sample, class Source, class Target>
void exchange_block(const Source& source, const Target& target) {
  constexpr std::size_t kRows = kSquare<Sample>;
  constexpr std::make_index_sequence<kRows> kAll;
  std::array<VectorOf<Sample>, kRows> rows;
  std::array<VectorOf<Sample>, kRows> next;
  for (std::size_t at = 0; at < kRows; ++at) std::memcpy(&rows[at], source(at), kVectorBytes);
  for (std::size_t round = 1; round < kRows; round *= 2) {
    for (std::size_t at = 0; at < kRows / 2; ++at) {
      const auto one = rows[at];
      const auto other = rows[at + kRows / 2];
      next[2 * at] = alternated<Sample, 0>(one, other, kAll);
      next[2 * at + 1] = alternated<Sample, kRows / 2>(one, other, kAll);
    }
    rows = next;
  }
  for (std::size_t at = 0; at < kRows; ++at) std::memcpy(target(at), &rows[at], kVectorBytes);
}

// A part of a slice: so many samples from `near` along its fast axis, and from `far` along the slow
// one, as they are numbered afterwards.
struct SlicePart {
  std::size_t near = 0;
  std::size_t far = 0;
  std::size_t rows = 0;
  std::size_t columns = 0;
};

template <class Sample>
void exchange_part(const Sample* from, const Side& fast, const Side& slow, const SlicePart& part,
                   Sample* to) {
  constexpr std::size_t kSide = kSquare<Sample>;
  const std::size_t first = fast.is_reversed ? fast.size - part.near - part.rows : part.near;
  const auto source = [&](std::size_t column) {
    return from + slow.place(part.far + column) * fast.size + first;
  };
  const auto target = [&](std::size_t row) {
    const std::size_t place = fast.is_reversed ? part.rows - 1 - row : row;
    return to + (part.near + place) * slow.size + part.far;
  };
  const std::size_t whole_rows = part.rows / kSide * kSide;
  const std::size_t whole_columns = part.columns / kSide * kSide;
  for (std::size_t row = 0; row < whole_rows; row += kSide) {
    for (std::size_t column = 0; column < whole_columns; column += kSide) {
      exchange_block<Sample>([&](std::size_t at) { return source(column + at) + row; },
                             [&](std::size_t at) { return target(row + at) + column; });
    }
  }
  for (std::size_t row = 0; row < part.rows; ++row) {
    for (std::size_t column = row < whole_rows ? whole_columns : 0; column < part.columns;
         ++column) {
      target(row)[column] = source(column)[row];
    }
  }
}

// Exchanges the axes of a slice, from one place to another.
template <class Sample>
void exchange(const Sample* from, const Side& fast, const Side& slow, Sample* to) {
  for (std::size_t near = 0; near < fast.size; near += kTileSide) {
    for (std::size_t far = 0; far < slow.size; far += kTileSide) {
      exchange_part(
          from, fast, slow,
          {near, far, std::min(kTileSide, fast.size - near), std::min(kTileSide, slow.size - far)},
          to);
    }
  }
}

template <class Sample>
class Turn {
 public:
  Turn(std::span<std::byte> samples, const std::array<std::uint32_t, 3>& dims,
       const AxisOrder& order, const std::stop_token& stop)
      : samples_(reinterpret_cast<Sample*>(samples.data())), stop_(stop) {
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
      check(stop_);
      Sample* const samples = samples_ + at * slice;
      if (is_small) {
        exchange(samples, axes_[0], axes_[1], copy.data());
        std::ranges::copy(copy, samples);
      } else {
        exchange_in_place(samples, 1, axes_[0], axes_[1], stop_);
      }
    }
    exchanged(axes_[0], axes_[1]);
  }

  void exchange_rows() {
    exchange_in_place(samples_, axes_[0].size, axes_[1], axes_[2], stop_);
    exchanged(axes_[1], axes_[2]);
  }

  static void exchanged(Side& one, Side& other) {
    std::swap(one, other);
    one.is_reversed = other.is_reversed = false;
  }

  // Exchanges each row with that at the other end of the reversed axes.
  void reverse_rest() {
    const auto& [x, y, z] = axes_;
    if (!x.is_reversed && !y.is_reversed && !z.is_reversed) return;
    std::vector<Sample> copy(x.size);
    for (std::size_t k = 0; k < z.size; ++k) {
      check(stop_);
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
  std::stop_token stop_;
  std::array<Side, 3> axes_;
};

}  // namespace

void put_in_order(std::span<std::byte> samples, std::size_t bytes_per_sample,
                  const std::array<std::uint32_t, 3>& dims, const AxisOrder& order,
                  const std::stop_token& stop) {
  if (order == kFilesOrder) return;
  const auto run = [&](auto sample) {
    Turn<decltype(sample)>(samples, dims, order, stop).run(order);
  };
  if (bytes_per_sample == 1) run(std::uint8_t{});
  if (bytes_per_sample == 2) run(std::uint16_t{});
  if (bytes_per_sample == 4) run(std::uint32_t{});
  if (bytes_per_sample == 8) run(std::uint64_t{});
}

void make_canonical(std::span<std::byte> samples, Volume& volume, const std::stop_token& stop) {
  const std::array<std::uint32_t, 3> dims = volume.dims;
  const AxisOrder order = make_canonical(volume.dims, volume.geometry);
  if (const auto fault = find_fault(volume.dims, volume.geometry)) {
    throw_unusable("The geometry of the volume cannot be used: " + fault->message + ".");
  }
  put_in_order(samples, bytes_per_sample(volume.type), dims, order, stop);
}

}  // namespace isomesh::volume
