// Histograms of any number of bins from one reading of the samples.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "proto/types.h"

namespace isomesh::volume {

// How often each value occurs: every value of its own for integers that span fewer than 65536
// values, else each 65536th part of the range.
struct ValueCounts {
  std::array<double, 2> range = {0, 0};  // smallest and largest value
  bool exact = false;                    // counts[b] counts the value range[0] + b
  std::vector<std::uint64_t> counts;
};

// Nothing counted yet, for samples of that type and range.
ValueCounts no_values(SampleType type, const std::array<double, 2>& range);

// Counts whole little-endian samples, aligned for their type, in addition to what `counts` has.
// Those that are no numbers count for nothing. Thread safe for different `counts`.
void add_values(std::span<const std::byte> samples, SampleType type, ValueCounts& counts);

// The same in `bins` bins of equal width over the range; a value at an edge belongs to the bin
// above, the largest to the last bin. Where the counts are not exact, all values of a part are
// taken for its middle. `bins` is at least 1. Thread safe.
std::vector<std::uint64_t> rebinned(const ValueCounts& values, std::size_t bins);

}  // namespace isomesh::volume
