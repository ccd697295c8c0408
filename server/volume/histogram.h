// Counts of values, from which histograms with any number of bins follow without rereading the
// samples.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "proto/types.h"

namespace isomesh::volume {

// The frequency of each value. Integers that span fewer than 65536 values are counted individually;
// otherwise the range has 65536 equal parts.
struct ValueCounts {
  std::array<double, 2> range = {0, 0};  // smallest and largest value
  bool exact = false;                    // counts[b] counts the value range[0] + b
  std::vector<std::uint64_t> counts;
};

// Zero counts for samples of that type and range.
ValueCounts no_values(SampleType type, const std::array<double, 2>& range);

// Adds whole little-endian samples, aligned for their type, to `counts`. Skips NaN. Thread safe for
// different `counts`.
void add_values(std::span<const std::byte> samples, SampleType type, ValueCounts& counts);

// Sums the counts into `bins` bins of equal width over the range. A value on an edge belongs to the
// upper bin, the largest value to the last bin. If the counts are not exact, a part belongs to the
// bin of its centre. `bins` is at least 1. Thread safe.
std::vector<std::uint64_t> rebinned(const ValueCounts& values, std::size_t bins);

}  // namespace isomesh::volume
