// From a sample's value to the number of its part; private to this folder.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>
#include <vector>

#include "server/mesh/label_parts.h"

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

  // The numbers of so many samples to `out`.
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

  // Labels come in runs: most are told by one comparison for all.
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

  PartNumber number_of(T value) const {
    if constexpr (kHasTable) {
      return table_[static_cast<Bits>(value)];
    } else {
      const auto found = std::ranges::lower_bound(entries_, value, {}, &Entry::value);
      return found != entries_.end() && found->value == value ? found->number : PartNumber{0};
    }
  }

  std::vector<PartNumber> table_;  // by the bits of the value
  std::vector<Entry> entries_;     // where there are too many values for a table, ascending
};

}  // namespace isomesh::mesh
