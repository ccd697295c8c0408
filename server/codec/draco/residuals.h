// Differences between values and their predictions. Private to this folder.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <vector>

#include "server/codec/draco/corners.h"
#include "server/codec/draco/quantise.h"
#include "server/codec/draco/value_order.h"
#include "server/mesh/buffer.h"

namespace isomesh::codec::edgebreaker {

// Three coordinates and an unused lane.
using Lanes = std::int32_t __attribute__((vector_size(16)));

inline Lanes lanes_of(const GridPoint& point) {
  std::uint16_t __attribute__((vector_size(8))) narrow;
  std::memcpy(&narrow, &point, sizeof narrow);
  return __builtin_convertvector(narrow, Lanes);
}

// Draco's wrap transform: differences modulo the extent of all coordinates, as symbols: 0, -1, 1,
// -2 become 0, 1, 2, 3.
class Wrap {
 public:
  explicit Wrap(const Extent& extent)
      : extent_(extent),
        span_(1 + extent.greatest - extent.least),
        most_((span_ - 1) / 2),
        least_(-(span_ / 2)) {}

  Lanes symbols_of(Lanes value, Lanes predicted) const {
    predicted = predicted < extent_.least ? extent_.least - Lanes{} : predicted;
    predicted = predicted > extent_.greatest ? extent_.greatest - Lanes{} : predicted;
    Lanes difference = value - predicted;
    // Comparisons yield all ones if true.
    difference += (difference < least_) & span_;
    difference -= (difference > most_) & span_;
    return (difference + difference) ^ (difference >> 31);
  }

  std::uint32_t symbols() const { return static_cast<std::uint32_t>(span_); }
  const Extent& extent() const { return extent_; }

 private:
  Extent extent_;
  std::int32_t span_;
  std::int32_t most_;
  std::int32_t least_;
};

// Counts symbols. One histogram per axis, so that counting the same symbol again does not wait for
// the previous store.
class Histogram {
 public:
  void reset(std::uint32_t symbols) {
    for (std::vector<std::uint32_t>& axis : counts_) axis.assign(symbols, 0);
  }
  std::uint32_t* axis(std::size_t axis) { return counts_[axis].data(); }
  std::uint64_t count(std::uint32_t symbol) const {
    return std::uint64_t{counts_[0][symbol]} + counts_[1][symbol] + counts_[2][symbol];
  }

 private:
  std::array<std::vector<std::uint32_t>, 3> counts_;
};

// The residuals of a surface's values, in order, three per vertex. Threads may predict disjoint
// ranges. Keeps its memory between surfaces.
class Residuals {
 public:
  void prepare(const Connectivity& surface, const GridPoint* points, const Extent& extent);

  // Predicts the values [begin, end) of the order from the opposite parallelogram, except first
  // values.
  void predict(const std::uint32_t* order, std::uint32_t begin, std::uint32_t end,
               Histogram& histogram);

  // Predicts first values from the preceding value in the stream.
  void predict_firsts(const ValueOrder& order, Histogram& histogram);

  const Wrap& wrap() const { return wrap_; }
  const std::uint16_t* symbols() const { return symbols_.data(); }

 private:
  Connectivity surface_;
  const GridPoint* points_ = nullptr;
  Wrap wrap_ = Wrap({});
  mesh::Buffer<std::uint16_t> symbols_;
};

}  // namespace isomesh::codec::edgebreaker
