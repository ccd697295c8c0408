// From a sample's value to the number of its label; private to this folder.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>
#include <vector>

namespace isomesh::mesh {

// A label's place among those that are asked for, from 1 on; 0 is the background, and every value
// that is not asked for.
using LabelNumber = std::uint16_t;

// Immutable, so safe to read from several threads.
template <class T>
class LabelIndex {
 public:
  // `labels` in ascending order.
  explicit LabelIndex(std::span<const std::int64_t> labels) {
    if constexpr (kHasTable) table_.resize(std::size_t{1} << std::numeric_limits<Bits>::digits);
    for (std::size_t n = 0; n < labels.size(); ++n) {
      if (labels[n] < std::numeric_limits<T>::min() || labels[n] > std::numeric_limits<T>::max()) {
        continue;  // no sample has it
      }
      const auto value = static_cast<T>(labels[n]);
      const auto number = static_cast<LabelNumber>(n + 1);
      if constexpr (kHasTable) {
        table_[static_cast<Bits>(value)] = number;
      } else {
        entries_.push_back({value, number});
      }
    }
  }

  // The numbers of so many samples to `out`.
  void translate(const T* samples, std::size_t count, LabelNumber* out) const {
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
    LabelNumber number;
  };

  // Labels come in runs: most are told by one comparison for all.
  void translate_run(const T* samples, std::size_t count, LabelNumber* out) const {
    T value = samples[0];
    LabelNumber number = number_of(value);
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

  LabelNumber number_of(T value) const {
    if constexpr (kHasTable) {
      return table_[static_cast<Bits>(value)];
    } else {
      const auto found = std::ranges::lower_bound(entries_, value, {}, &Entry::value);
      return found != entries_.end() && found->value == value ? found->number : LabelNumber{0};
    }
  }

  std::vector<LabelNumber> table_;  // by the bits of the value
  std::vector<Entry> entries_;      // where there are too many values for a table, ascending
};

}  // namespace isomesh::mesh
