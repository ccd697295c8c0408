// Counts of values, of which histograms with any number of bins are made without another reading of
// the samples.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "proto/types.h"

namespace isomesh::volume {

// How often each value occurs. Integers that span fewer than 65536 values are counted one by one;
// for all others the range is divided into 65536 parts.
struct ValueCounts {
  std::array<double, 2> range = {0, 0};  // smallest and largest value
  bool exact = false;                    // counts[b] counts the value range[0] + b
  std::vector<std::uint64_t> counts;
};

// Counts of 0, for samples of that type and range.
ValueCounts no_values(SampleType type, const std::array<double, 2>& range);

// Counts whole little-endian samples, aligned for their type, in addition to what `counts` has.
// Samples that are no numbers are not counted. Thread safe for different `counts`.
void add_values(std::span<const std::byte> samples, SampleType type, ValueCounts& counts);

// Sums the counts in `bins` bins of equal width over the range. A value at an edge counts for the
// bin above, the largest value for the last bin. Where the counts are not exact, all values of a
// part count for the bin of its middle. `bins` is at least 1. Thread safe.
std::vector<std::uint64_t> rebinned(const ValueCounts& values, std::size_t bins);

}  // namespace isomesh::volume
