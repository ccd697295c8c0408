#include "server/volume/labels.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <type_traits>
#include <unordered_set>
#include <utility>
#include <vector>

#include "base/text.h"
#include "proto/samples.h"

namespace isomesh::volume {
namespace {

constexpr std::size_t kMostLabels = 1024;
constexpr std::size_t kFewestValues = 3;
constexpr std::size_t kPieceSamples = std::size_t{1} << 20;  // per count of the values
// The smallest fraction of equal neighbours. In regions five samples wide along x, a fifth of the
// pairs is at a border; 8-bit images have hardly any equal pairs.
constexpr double kFlat = 0.6;

template <class Sample>
class Values {
 public:
  void add(std::span<const Sample> samples) {
    for (const Sample value : samples) {
      if (value == last_ && !seen_.empty()) continue;  // the usual case
      last_ = value;
      seen_.insert(value);
    }
  }
  std::size_t count() const { return seen_.size(); }

 private:
  Sample last_ = 0;
  std::unordered_set<Sample> seen_;
};

template <class Sample>
requires(sizeof(Sample) <= 2) class Values<Sample> {
 public:
  void add(std::span<const Sample> samples) {
    for (const Sample value : samples) seen_[static_cast<std::make_unsigned_t<Sample>>(value)] = 1;
  }
  std::size_t count() const {
    return static_cast<std::size_t>(std::ranges::count(seen_, std::uint8_t{1}));
  }

 private:
  std::vector<std::uint8_t> seen_ = std::vector<std::uint8_t>(std::size_t{1} << 8 * sizeof(Sample));
};

struct Neighbours {
  std::size_t pairs = 0;  // not both background
  std::size_t same = 0;
};

template <class Sample>
Neighbours neighbours_in(std::span<const Sample> line, Sample background) {
  // Few enough to count in a byte, so that the compiler vectorises the comparison.
  constexpr std::size_t kBlock = 255;
  Neighbours found;
  for (std::size_t begin = 1; begin < line.size(); begin += kBlock) {
    const std::size_t count = std::min(kBlock, line.size() - begin);
    const Sample* at = line.data() + begin;
    const Sample* before = at - 1;
    std::uint8_t same = 0;
    std::uint8_t empty = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const auto is_same = std::uint8_t{at[i] == before[i]};
      same += is_same;
      empty += is_same & std::uint8_t{at[i] == background};
    }
    found.pairs += count - empty;
    found.same += same - empty;
  }
  return found;
}

template <class Sample>
std::optional<std::size_t> count_labels(std::span<const Sample> samples, std::size_t row) {
  // As one line, which is faster than row by row, without the pairs of two rows.
  Neighbours found = neighbours_in(samples, samples.front());
  for (std::size_t begin = row; begin < samples.size(); begin += row) {
    const Neighbours apart = neighbours_in(samples.subspan(begin - 1, 2), samples.front());
    found.pairs -= apart.pairs;
    found.same -= apart.same;
  }
  if (static_cast<double>(found.same) < kFlat * static_cast<double>(found.pairs)) {
    return std::nullopt;
  }
  Values<Sample> values;
  for (std::size_t begin = 0; begin < samples.size(); begin += kPieceSamples) {
    values.add(samples.subspan(begin, std::min(kPieceSamples, samples.size() - begin)));
    if (values.count() > kMostLabels) return std::nullopt;
  }
  if (values.count() < kFewestValues) return std::nullopt;
  return values.count();
}

template <class Sample>
bool has_only(std::span<const Sample> samples, Sample one, Sample other) {
  // As above. Most volumes end in the first block with anything.
  constexpr std::size_t kBlock = 255;
  for (std::size_t begin = 0; begin < samples.size(); begin += kBlock) {
    const std::size_t count = std::min(kBlock, samples.size() - begin);
    const Sample* const at = samples.data() + begin;
    std::uint8_t found = 0;
    for (std::size_t i = 0; i < count; ++i) {
      found += std::uint8_t{at[i] == one} | std::uint8_t{at[i] == other};
    }
    if (found != count) return false;
  }
  return true;
}

// The smallest and the largest sample. Empty if one is no whole number, or no 32-bit integer.
template <class Sample>
std::optional<std::pair<std::int64_t, std::int64_t>> whole_range(std::span<const Sample> samples) {
  constexpr double kLow = std::numeric_limits<std::int32_t>::min();
  constexpr double kHigh = std::numeric_limits<std::uint32_t>::max();
  std::int64_t low = std::numeric_limits<std::int64_t>::max();
  std::int64_t high = std::numeric_limits<std::int64_t>::min();
  for (const Sample sample : samples) {
    const auto value = static_cast<double>(sample);
    if (!(value >= kLow && value <= kHigh)) return std::nullopt;  // also NaN
    const auto whole = static_cast<std::int64_t>(value);
    if (static_cast<double>(whole) != value) return std::nullopt;
    low = std::min(low, whole);
    high = std::max(high, whole);
  }
  return std::pair(low, high);
}

template <class Sample>
bool holds(std::int64_t low, std::int64_t high) {
  if constexpr (std::is_integral_v<Sample>) {
    return low >= std::numeric_limits<Sample>::min() && high <= std::numeric_limits<Sample>::max();
  } else {
    return false;
  }
}

bool is_entry(const LabelEntry& entry) {
  return entry.name.size() <= LabelEntry::kMostNameBytes && !has_control_characters(entry.name) &&
         (!entry.color || is_color(*entry.color)) &&
         std::ranges::adjacent_find(entry.values, std::greater_equal()) == entry.values.end();
}

}  // namespace

bool is_label_table(std::span<const LabelEntry> labels) {
  return labels.size() <= Volume::kMostLabels && std::ranges::all_of(labels, is_entry) &&
         std::ranges::adjacent_find(labels, std::greater_equal(), &LabelEntry::label) ==
             labels.end();
}

std::optional<SampleType> whole_type(std::span<const std::byte> samples, SampleType type) {
  const auto range = with_sample(type, [&](auto sample) {
    using Sample = decltype(sample);
    const auto* first = reinterpret_cast<const Sample*>(samples.data());
    return whole_range(std::span(first, samples.size() / sizeof(Sample)));
  });
  if (!range) return std::nullopt;
  for (const SampleType each : {SampleType::kUint8, SampleType::kInt8, SampleType::kUint16,
                                SampleType::kInt16, SampleType::kUint32, SampleType::kInt32}) {
    const bool fits = with_sample(
        each, [&](auto sample) { return holds<decltype(sample)>(range->first, range->second); });
    if (fits) return each;
  }
  return std::nullopt;
}

std::optional<std::int64_t> mask_value(std::span<const std::byte> samples, SampleType type,
                                       const std::array<double, 2>& range) {
  constexpr double kMost = std::numeric_limits<std::uint32_t>::max();
  const double high = range[1];
  if (range[0] != 0 || !(high > 0 && high <= kMost) || high != std::floor(high))
    return std::nullopt;
  const bool is_mask = with_sample(type, [&](auto sample) {
    using Sample = decltype(sample);
    const auto* first = reinterpret_cast<const Sample*>(samples.data());
    return has_only(std::span(first, samples.size() / sizeof(Sample)), Sample{0},
                    static_cast<Sample>(high));
  });
  if (!is_mask) return std::nullopt;
  return static_cast<std::int64_t>(high);
}

std::optional<std::size_t> label_count(std::span<const std::byte> samples, SampleType type,
                                       const std::array<std::uint32_t, 3>& dims) {
  if (!is_integer(type) && !whole_type(samples, type)) return std::nullopt;
  return with_sample(type, [&](auto sample) {
    using Sample = decltype(sample);
    const auto* first = reinterpret_cast<const Sample*>(samples.data());
    return count_labels(std::span(first, samples.size() / sizeof(Sample)), dims[0]);
  });
}

}  // namespace isomesh::volume
