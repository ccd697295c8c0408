#include "server/volume/labels.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <type_traits>
#include <unordered_set>
#include <vector>

#include "base/text.h"
#include "proto/samples.h"
#include "server/volume/unusable.h"

namespace isomesh::volume {
namespace {

template <class Sample>
std::span<const Sample> as_samples(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const Sample*>(bytes.data()), bytes.size() / sizeof(Sample)};
}

constexpr std::size_t kMostLabels = 1024;
constexpr std::size_t kFewestValues = 2;
// The largest distance of a stored label to its whole number: labels that were scaled or resampled.
constexpr double kNearlyWhole = 1e-3;
constexpr std::size_t kPieceSamples = std::size_t{1} << 20;  // per count of the values
// The smallest fraction of equal neighbours. In regions five samples wide along x, a fifth of the
// pairs is at a border; 8-bit images have hardly any equal pairs.
constexpr double kFlat = 0.6;

// True if two samples are the same whole number. Floats are nearly whole.
template <class Sample>
bool is_same_label(Sample one, Sample other) {
  if constexpr (std::is_integral_v<Sample>) {
    return one == other;
  } else {
    return std::abs(one - other) < Sample{0.5};
  }
}

template <class Sample>
class Values {
 public:
  void add(std::span<const Sample> samples) {
    for (const Sample value : samples) {
      if (value == last_ && !seen_.empty()) continue;  // the usual case
      last_ = value;
      seen_.insert(whole_number(value));
    }
  }
  std::size_t count() const { return seen_.size(); }
  std::vector<std::int64_t> all() const {
    std::vector<std::int64_t> values(seen_.begin(), seen_.end());
    std::ranges::sort(values);
    return values;
  }

 private:
  Sample last_ = 0;
  std::unordered_set<std::int64_t> seen_;
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
  std::vector<std::int64_t> all() const {
    std::vector<std::int64_t> values;
    for (std::int64_t value = std::numeric_limits<Sample>::min();
         value <= std::numeric_limits<Sample>::max(); ++value) {
      const auto place = static_cast<std::make_unsigned_t<Sample>>(value);
      if (seen_[place] != 0) values.push_back(value);
    }
    return values;
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
      const auto is_same = std::uint8_t{is_same_label(at[i], before[i])};
      same += is_same;
      empty += is_same & std::uint8_t{is_same_label(at[i], background)};
    }
    found.pairs += count - empty;
    found.same += same - empty;
  }
  return found;
}

template <class Sample>
double share_of_equal(std::span<const Sample> samples, std::size_t row) {
  // As one line, which is faster than row by row, without the pairs of two rows.
  Neighbours found = neighbours_in(samples, samples.front());
  for (std::size_t begin = row; begin < samples.size(); begin += row) {
    const Neighbours apart = neighbours_in(samples.subspan(begin - 1, 2), samples.front());
    found.pairs -= apart.pairs;
    found.same -= apart.same;
  }
  return found.pairs == 0 ? 1 : static_cast<double>(found.same) / static_cast<double>(found.pairs);
}

// Empty if there are more values.
template <class Sample>
std::optional<Values<Sample>> values_of(std::span<const Sample> samples, std::size_t most) {
  Values<Sample> values;
  for (std::size_t begin = 0; begin < samples.size(); begin += kPieceSamples) {
    values.add(samples.subspan(begin, std::min(kPieceSamples, samples.size() - begin)));
    if (values.count() > most) return std::nullopt;
  }
  return values;
}

template <class Sample>
std::optional<std::size_t> count_labels(std::span<const Sample> samples, std::size_t row) {
  if (share_of_equal(samples, row) < kFlat) return std::nullopt;
  const auto values = values_of(samples, kMostLabels);
  if (!values || values->count() < kFewestValues) return std::nullopt;
  return values->count();
}

template <class Sample>
bool is_nearly(Sample sample, Sample whole) {
  if constexpr (std::is_integral_v<Sample>) {
    return sample == whole;
  } else {
    return std::abs(sample - whole) <= static_cast<Sample>(kNearlyWhole);
  }
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
      found += std::uint8_t{is_nearly(at[i], one)} | std::uint8_t{is_nearly(at[i], other)};
    }
    if (found != count) return false;
  }
  return true;
}

// Empty if a finite sample is not nearly whole, or no 32-bit integer, or if none is finite. The
// type is not set.
template <class Sample>
std::optional<WholeNumbers> whole_numbers_in(std::span<const Sample> samples) {
  WholeNumbers found = {.low = std::numeric_limits<std::int64_t>::max(),
                        .high = std::numeric_limits<std::int64_t>::min()};
  for (const Sample sample : samples) {
    const auto value = static_cast<double>(sample);
    if (!is_nearly_whole(value)) return std::nullopt;
    const std::int64_t whole = whole_number(value);
    found.is_exact = found.is_exact && static_cast<double>(whole) == value;
    found.low = std::min(found.low, whole);
    found.high = std::max(found.high, whole);
  }
  return found;
}

template <class Sample>
bool holds(std::int64_t low, std::int64_t high) {
  if constexpr (std::is_integral_v<Sample>) {
    return low >= std::numeric_limits<Sample>::min() && high <= std::numeric_limits<Sample>::max();
  } else {
    return false;
  }
}

[[noreturn]] void throw_no_label(double sample) {
  throw_unusable(
      "Labels are whole numbers of 32 bits, but one of the samples is " + to_text(sample) +
      ". Use an iso-value instead of labels, or round the samples and upload them again.");
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

bool is_nearly_whole(double value) {
  constexpr double kLow = std::numeric_limits<std::int32_t>::min();
  constexpr double kHigh = std::numeric_limits<std::uint32_t>::max();
  return value > kLow - kNearlyWhole && value < kHigh + kNearlyWhole &&
         std::abs(value - static_cast<double>(whole_number(value))) <= kNearlyWhole;
}

std::optional<WholeNumbers> whole_numbers(std::span<const std::byte> samples, SampleType type) {
  auto found = with_sample(
      type, [&](auto sample) { return whole_numbers_in(as_samples<decltype(sample)>(samples)); });
  if (!found) return std::nullopt;
  for (const SampleType each : {SampleType::kUint8, SampleType::kInt8, SampleType::kUint16,
                                SampleType::kInt16, SampleType::kUint32, SampleType::kInt32}) {
    const bool fits = with_sample(
        each, [&](auto sample) { return holds<decltype(sample)>(found->low, found->high); });
    if (!fits) continue;
    found->type = each;
    return found;
  }
  return std::nullopt;
}

void store_whole(std::span<const std::byte> samples, SampleType from, SampleType to,
                 std::byte* target) {
  with_sample(from, [&](auto stored) {
    with_sample(to, [&](auto whole) {
      using Whole = decltype(whole);
      for (std::size_t at = 0; at < samples.size(); at += sizeof(stored)) {
        std::memcpy(&stored, samples.data() + at, sizeof(stored));
        whole = static_cast<Whole>(whole_number(static_cast<double>(stored)));
        std::memcpy(target, &whole, sizeof(whole));
        target += sizeof(whole);
      }
    });
  });
}

Note rounded_note(SampleType stored) {
  return note_of(NoteCode::kLabelsRounded,
                 "The labels are stored as " + std::string(to_string(stored)) +
                     ", and some are not quite whole numbers. They were rounded; no sample changed "
                     "by more than 0.001.");
}

template <class Sample>
bool round_labels(std::span<const Sample> samples, std::int32_t* target) {
  bool is_rounded = false;
  for (const Sample sample : samples) {
    const auto value = static_cast<double>(sample);
    constexpr double kMost = std::numeric_limits<std::int32_t>::max();
    if (!is_nearly_whole(value) || value > kMost) throw_no_label(value);
    const auto whole = static_cast<std::int32_t>(whole_number(value));
    is_rounded = is_rounded || static_cast<double>(whole) != value;
    *target++ = whole;
  }
  return is_rounded;
}

template bool round_labels(std::span<const float> samples, std::int32_t* target);
template bool round_labels(std::span<const double> samples, std::int32_t* target);

std::optional<std::int64_t> mask_value(std::span<const std::byte> samples, SampleType type,
                                       const std::array<double, 2>& range) {
  constexpr double kMost = std::numeric_limits<std::uint32_t>::max();
  const double high = std::round(range[1]);
  if (std::abs(range[0]) > kNearlyWhole || !(high > 0 && high <= kMost)) return std::nullopt;
  const bool is_mask = with_sample(type, [&](auto sample) {
    using Sample = decltype(sample);
    return has_only(as_samples<Sample>(samples), Sample{0}, static_cast<Sample>(high));
  });
  if (!is_mask) return std::nullopt;
  return static_cast<std::int64_t>(high);
}

std::optional<std::size_t> label_count(std::span<const std::byte> samples, SampleType type,
                                       const std::array<std::uint32_t, 3>& dims) {
  return with_sample(type, [&](auto sample) {
    return count_labels(as_samples<decltype(sample)>(samples), dims[0]);
  });
}

std::optional<std::vector<std::int64_t>> distinct_values(std::span<const std::byte> samples,
                                                         SampleType type, std::size_t most) {
  return with_sample(type, [&](auto sample) -> std::optional<std::vector<std::int64_t>> {
    const auto values = values_of(as_samples<decltype(sample)>(samples), most);
    if (!values) return std::nullopt;
    return values->all();
  });
}

double share_of_equal_neighbours(std::span<const std::byte> samples, SampleType type,
                                 const std::array<std::uint32_t, 3>& dims) {
  return with_sample(type, [&](auto sample) {
    return share_of_equal(as_samples<decltype(sample)>(samples), dims[0]);
  });
}

}  // namespace isomesh::volume
