#include "server/volume/histogram.h"

#include <algorithm>
#include <functional>
#include <type_traits>

#include "proto/samples.h"
#include "server/volume/statistics.h"

namespace isomesh::volume {
namespace {

constexpr std::size_t kMostValues = 65536;

// Halved, because the difference of two doubles may overflow.
double half_width(const std::array<double, 2>& range) { return range[1] / 2 - range[0] / 2; }

// The bin, of so many over the same range, of the counts' b-th value. In integers, because a value
// on the edge of two bins is in the upper one.
std::size_t bin_of(const ValueCounts& values, std::size_t b, std::size_t bins) {
  const std::size_t count = values.counts.size();
  if (!values.exact) return (2 * b + 1) * bins / (2 * count);
  return count > 1 ? std::min(b * bins / (count - 1), bins - 1) : 0;
}

}  // namespace

ValueCounts no_values(SampleType type, const std::array<double, 2>& range) {
  ValueCounts values;
  values.range = range;
  values.exact = is_integer(type) && half_width(range) * 2 < static_cast<double>(kMostValues);
  values.counts.resize(values.exact ? static_cast<std::size_t>(range[1] - range[0]) + 1
                                    : kMostValues);
  return values;
}

void add_values(std::span<const std::byte> samples, SampleType type, ValueCounts& counts) {
  // With half a step on both sides, each integer is at the centre of its bin.
  const double margin = counts.exact ? 0.5 : 0;
  const std::vector<std::uint64_t> more = histogram(
      samples, type, {{counts.range[0] - margin, counts.range[1] + margin}, counts.counts.size()});
  std::ranges::transform(more, counts.counts, counts.counts.begin(), std::plus());
}

std::vector<std::uint64_t> rebinned(const ValueCounts& values, std::size_t bins) {
  std::vector<std::uint64_t> result(bins);
  for (std::size_t b = 0; b < values.counts.size(); ++b) {
    result[bin_of(values, b, bins)] += values.counts[b];
  }
  return result;
}

}  // namespace isomesh::volume
