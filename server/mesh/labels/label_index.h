// Each value of the samples with what is counted of it, or the number of its part; private to the
// kernels.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <unordered_map>
#include <utility>
#include <vector>

#include "server/mesh/labels/label_parts.h"
#include "server/mesh/lattice/lattice.h"

// Writes X(type of C++) once for each type of sample that a label can have.
#define ISOMESH_FOR_EACH_LABEL_TYPE(X) \
  X(std::uint8_t)                      \
  X(std::int8_t)                       \
  X(std::uint16_t)                     \
  X(std::int16_t)                      \
  X(std::uint32_t)                     \
  X(std::int32_t)

namespace isomesh::mesh {

// A row for each value of samples: of all values, if those are few, or else of the ones that were
// met.
template <class T, class Row>
class ValueTable {
 public:
  ValueTable() {
    if constexpr (kHasAll) rows_.resize(std::size_t{1} << std::numeric_limits<Bits>::digits);
  }

  Row& operator[](T value) { return rows_[static_cast<Bits>(value)]; }

  // The row, or an empty one of a value that was not met.
  Row at(T value) const {
    const auto bits = static_cast<Bits>(value);
    if constexpr (kHasAll) {
      return rows_[bits];
    } else {
      const auto found = rows_.find(bits);
      return found == rows_.end() ? Row{} : found->second;
    }
  }

  bool has_met_more_than(std::size_t values) const { return !kHasAll && rows_.size() > values; }

  // Calls visit(value, row) for all rows.
  template <class Visit>
  void visit(Visit visit) const {
    if constexpr (kHasAll) {
      for (std::size_t bits = 0; bits < rows_.size(); ++bits) {
        visit(static_cast<T>(static_cast<Bits>(bits)), rows_[bits]);
      }
    } else {
      for (const auto& [bits, row] : rows_) visit(static_cast<T>(bits), row);
    }
  }

 private:
  using Bits = std::make_unsigned_t<T>;
  static constexpr bool kHasAll = sizeof(T) <= 2;

  std::conditional_t<kHasAll, std::vector<Row>, std::unordered_map<Bits, Row>> rows_;
};

// The part number of each sample of a lattice, behind one interface for all sample types, so that
// the walk over labels is compiled once. Immutable, so safe to read from several threads.
class SampleParts {
 public:
  virtual ~SampleParts() = default;

  virtual const Dims& dims() const = 0;
  // That of one sample; x is fastest.
  virtual PartNumber part(std::uint64_t sample) const = 0;
  // Writes the numbers of a row's samples to `out`, which has room for dims().x of them.
  virtual void copy_row(std::uint32_t y, std::uint32_t z, PartNumber* out) const = 0;
};

// The numbers that `parts` gives the values of `lattice`, which must outlive this.
template <class T>
class PartsOf final : public SampleParts {
 public:
  PartsOf(const Lattice<T>& lattice, const LabelParts& parts) : lattice_(lattice) {
    for (const auto& [value, number] : parts.values()) {
      if (std::in_range<T>(value))
        numbers_[static_cast<T>(value)] = number;  // no sample has others
    }
  }

  const Dims& dims() const override { return lattice_.dims; }

  PartNumber part(std::uint64_t sample) const override {
    return numbers_.at(lattice_.samples[sample]);
  }

  void copy_row(std::uint32_t y, std::uint32_t z, PartNumber* out) const override {
    const std::size_t width = lattice_.dims.x;
    const T* row = lattice_.samples + (std::size_t{z} * lattice_.dims.y + y) * width;
    for (std::size_t begin = 0; begin < width; begin += kRun) {
      translate_run(row + begin, std::min(kRun, width - begin), out + begin);
    }
  }

 private:
  static constexpr std::size_t kRun = 64;

  // Neighbours mostly have the same label, so one comparison usually serves a whole run.
  void translate_run(const T* samples, std::size_t count, PartNumber* out) const {
    T value = samples[0];
    PartNumber number = numbers_.at(value);
    T change = 0;
    for (std::size_t i = 0; i < count; ++i) change |= static_cast<T>(samples[i] ^ value);
    if (change == 0) {
      std::fill_n(out, count, number);
      return;
    }
    for (std::size_t i = 0; i < count; ++i) {
      if (samples[i] != value) number = numbers_.at(value = samples[i]);
      out[i] = number;
    }
  }

  const Lattice<T>& lattice_;
  ValueTable<T, PartNumber> numbers_;
};

}  // namespace isomesh::mesh
