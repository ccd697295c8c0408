#include "server/volume/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "proto/samples.h"

namespace isomesh::volume {
namespace {

constexpr std::size_t kMostExactBins = 65536;
constexpr std::size_t kBins = 1024;

template <class Sample>
std::span<const Sample> as(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const Sample*>(bytes.data()), bytes.size() / sizeof(Sample)};
}

template <class Sample>
std::vector<std::uint64_t> count_samples(std::span<const Sample> samples, const Bins& bins) {
  std::vector<std::uint64_t> counts(bins.count);
  // Halved, because the difference of two doubles may overflow.
  const double low = bins.range[0] / 2;
  const double width = bins.range[1] / 2 - low;
  const auto bin_count = static_cast<double>(bins.count);
  // Multiplied first, integers on the edge of two bins come into the upper one.
  const bool can_multiply = std::isfinite(width * bin_count);
  const auto bin_of = [&](double value) {
    if (!(width > 0)) return 0.0;
    const double above = value / 2 - low;
    return can_multiply ? above * bin_count / width : above / width * bin_count;
  };
  for (const Sample sample : samples) {
    const auto value = static_cast<double>(sample);
    if (!(value >= bins.range[0] && value <= bins.range[1])) continue;
    ++counts[std::min(static_cast<std::size_t>(bin_of(value)), bins.count - 1)];
  }
  return counts;
}

// Bin b counts the value lowest + b.
template <class Sample>
std::vector<std::uint64_t> count_values(std::span<const Sample> samples, std::int64_t lowest,
                                        std::size_t bins) {
  // Neighbours are often equal, and a processor adds to one place in memory only every few cycles.
  // So neighbours are counted in tables of their own.
  constexpr std::size_t kTables = 4;
  constexpr std::size_t kPiece = std::size_t{1} << 30;  // counted without overflow
  std::vector<std::uint64_t> counts(bins);
  std::vector<std::uint32_t> tables(kTables * bins);
  const auto bin_of = [&](Sample sample) {
    return static_cast<std::size_t>(std::int64_t{sample} - lowest);
  };
  for (; !samples.empty(); samples = samples.subspan(std::min(kPiece, samples.size()))) {
    const auto piece = samples.first(std::min(kPiece, samples.size()));
    std::ranges::fill(tables, 0);
    std::size_t at = 0;
    for (; at + kTables <= piece.size(); at += kTables) {
      for (std::size_t i = 0; i < kTables; ++i) ++tables[i * bins + bin_of(piece[at + i])];
    }
    for (; at < piece.size(); ++at) ++tables[bin_of(piece[at])];
    for (std::size_t i = 0; i < kTables; ++i) {
      for (std::size_t bin = 0; bin < bins; ++bin) counts[bin] += tables[i * bins + bin];
    }
  }
  return counts;
}

// One sample of that value remains at least, because the value is in the range.
void leave_out(std::uint64_t samples, std::uint64_t& count) {
  if (count > 0) count -= std::min(samples, count - 1);
}

Statistics from_value_counts(std::span<std::uint64_t> counts, std::int64_t lowest,
                             std::uint64_t left_out) {
  const auto is_hit = [](std::uint64_t count) { return count > 0; };
  const auto first = std::find_if(counts.begin(), counts.end(), is_hit) - counts.begin();
  const auto beyond = counts.rend() - std::find_if(counts.rbegin(), counts.rend(), is_hit);
  Statistics statistics;
  if (first == std::ssize(counts)) return statistics;
  statistics.range = {static_cast<double>(lowest + first),
                      static_cast<double>(lowest + beyond - 1)};
  leave_out(left_out, counts[static_cast<std::size_t>(first)]);
  statistics.otsu = otsu_threshold(
      counts.subspan(static_cast<std::size_t>(first), static_cast<std::size_t>(beyond - first)),
      {statistics.range[0] - 0.5, statistics.range[1] + 0.5});
  return statistics;
}

template <class Sample>
Statistics range_of(std::span<const Sample> samples) {
  Statistics statistics;
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const Sample sample : samples) {
    const auto value = static_cast<double>(sample);
    const bool finite = std::isfinite(value);
    statistics.non_finite += finite ? 0 : 1;
    low = finite && value < low ? value : low;
    high = finite && value > high ? value : high;
  }
  if (low <= high) statistics.range = {low, high};
  return statistics;
}

template <class Sample>
Statistics measure_wide(std::span<const Sample> samples, std::uint64_t left_out) {
  Statistics statistics = range_of(samples);
  const auto [low, high] = statistics.range;
  if constexpr (std::is_integral_v<Sample>) {
    if (high - low < static_cast<double>(kMostExactBins)) {
      const auto lowest = static_cast<std::int64_t>(low);
      const auto bins = static_cast<std::size_t>(high - low) + 1;
      std::vector<std::uint64_t> counts = count_values(samples, lowest, bins);
      return from_value_counts(counts, lowest, left_out);
    }
  }
  if (statistics.non_finite == samples.size() || low == high) {
    statistics.otsu = low;
  } else {
    std::vector<std::uint64_t> counts = count_samples(samples, {statistics.range, kBins});
    leave_out(left_out, counts.front());
    statistics.otsu = otsu_threshold(counts, statistics.range);
  }
  return statistics;
}

template <class Sample>
Statistics measure_samples(std::span<const Sample> samples, std::uint64_t left_out) {
  if constexpr (sizeof(Sample) <= 2) {
    // One count per possible value fits into memory, so the range is not needed first.
    constexpr std::size_t kValues = std::size_t{1} << (8 * sizeof(Sample));
    if (samples.size() < kValues)
      return measure_wide(samples, left_out);  // a second walk takes less time than zeroing
    constexpr std::int64_t kLowest = std::is_signed_v<Sample> ? -std::int64_t{kValues / 2} : 0;
    std::vector<std::uint64_t> counts = count_values(samples, kLowest, kValues);
    return from_value_counts(counts, kLowest, left_out);
  } else {
    return measure_wide(samples, left_out);
  }
}

}  // namespace

Statistics measure(std::span<const std::byte> samples, SampleType type, std::uint64_t left_out) {
  return with_sample(
      type, [&](auto sample) { return measure_samples(as<decltype(sample)>(samples), left_out); });
}

std::vector<std::uint64_t> histogram(std::span<const std::byte> samples, SampleType type,
                                     const Bins& bins) {
  return with_sample(
      type, [&](auto sample) { return count_samples(as<decltype(sample)>(samples), bins); });
}

double otsu_threshold(std::span<const std::uint64_t> counts, const std::array<double, 2>& range) {
  double total = 0;
  double moment = 0;
  for (std::size_t bin = 0; bin < counts.size(); ++bin) {
    total += static_cast<double>(counts[bin]);
    moment += static_cast<double>(counts[bin]) * static_cast<double>(bin);
  }

  double below = 0;
  double below_moment = 0;
  double best = -1;
  std::size_t last = 0;        // the last bin with samples so far
  std::size_t best_lower = 0;  // the last bin of the lower class
  std::size_t best_upper = 0;  // the first bin of the upper class
  for (std::size_t bin = 0; bin < counts.size(); ++bin) {
    if (counts[bin] == 0) continue;
    if (below > 0) {
      const double difference = below_moment / below - (moment - below_moment) / (total - below);
      const double variance = below * (total - below) * difference * difference;
      if (variance > best) {
        best = variance;
        best_lower = last;
        best_upper = bin;
      }
    } else {
      best_lower = best_upper = bin;
    }
    below += static_cast<double>(counts[bin]);
    below_moment += static_cast<double>(counts[bin]) * static_cast<double>(bin);
    last = bin;
  }

  // The threshold is midway between the centres of the two bins; for a single bin its centre.
  const double at = (static_cast<double>(best_lower + best_upper) + 1) / 2;
  const double half_bin = (range[1] / 2 - range[0] / 2) / static_cast<double>(counts.size());
  return range[0] + half_bin * at + half_bin * at;
}

}  // namespace isomesh::volume
