// From a sample's value to the number of its part; private to the kernels.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>
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

// Immutable, so safe to read from several threads.
template <class T>
class LabelIndex {
 public:
  explicit LabelIndex(const LabelParts& parts) {
    if constexpr (kHasTable) table_.resize(std::size_t{1} << std::numeric_limits<Bits>::digits);
    for (const auto& [wide, number] : parts.values()) {
      if (wide < std::numeric_limits<T>::min() || wide > std::numeric_limits<T>::max()) {
        continue;  // no sample has it
      }
      const auto value = static_cast<T>(wide);
      if constexpr (kHasTable) {
        table_[static_cast<Bits>(value)] = number;
      } else {
        entries_.push_back({value, number});
      }
    }
  }

  PartNumber number_of(T value) const {
    if constexpr (kHasTable) {
      return table_[static_cast<Bits>(value)];
    } else {
      const auto found = std::ranges::lower_bound(entries_, value, {}, &Entry::value);
      return found != entries_.end() && found->value == value ? found->number : PartNumber{0};
    }
  }

  // Writes the part numbers of `count` samples to `out`.
  void translate(const T* samples, std::size_t count, PartNumber* out) const {
    for (std::size_t begin = 0; begin < count; begin += kRun) {
      translate_run(samples + begin, std::min(kRun, count - begin), out + begin);
    }
  }

 private:
  using Bits = std::make_unsigned_t<T>;
  static constexpr bool kHasTable = sizeof(T) <= 2;
  static constexpr std::size_t kRun = 64;

  struct Entry {
    T value;
    PartNumber number;
  };

  // Neighbours mostly have the same label, so one comparison usually serves a whole run.
  void translate_run(const T* samples, std::size_t count, PartNumber* out) const {
    T value = samples[0];
    PartNumber number = number_of(value);
    T change = 0;
    for (std::size_t i = 0; i < count; ++i) change |= static_cast<T>(samples[i] ^ value);
    if (change == 0) {
      std::fill_n(out, count, number);
      return;
    }
    for (std::size_t i = 0; i < count; ++i) {
      if (samples[i] != value) number = number_of(value = samples[i]);
      out[i] = number;
    }
  }

  std::vector<PartNumber> table_;  // by the bits of the value
  std::vector<Entry> entries_;     // where there are too many values for a table, ascending
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
  PartsOf(const Lattice<T>& lattice, const LabelParts& parts) : lattice_(lattice), index_(parts) {}

  const Dims& dims() const override { return lattice_.dims; }

  PartNumber part(std::uint64_t sample) const override {
    return index_.number_of(lattice_.samples[sample]);
  }

  void copy_row(std::uint32_t y, std::uint32_t z, PartNumber* out) const override {
    const Dims& dims = lattice_.dims;
    index_.translate(lattice_.samples + (std::size_t{z} * dims.y + y) * dims.x, dims.x, out);
  }

 private:
  const Lattice<T>& lattice_;
  const LabelIndex<T> index_;
};

}  // namespace isomesh::mesh
