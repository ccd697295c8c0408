// Recognises label maps and validates their labels.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "proto/types.h"

namespace isomesh::volume {

// The nearest whole number. `value` is finite and less than 2^62 in size.
inline std::int64_t whole_number(double value) {
  return static_cast<std::int64_t>(value + (value < 0 ? -0.5 : 0.5));
}

// True for a number that is at most 0.001 from a whole one of 32 bits. Labels that were scaled or
// resampled are not quite whole.
bool is_nearly_whole(double value);

struct WholeNumbers {
  SampleType type = SampleType::kUint8;  // the smallest integer type that holds all of them
  std::int64_t low = 0;
  std::int64_t high = 0;
  bool is_exact = true;  // no sample has to be rounded
};

// The samples as whole numbers. Empty unless all are nearly whole and fit into one type. `samples`
// as for measure(). Thread safe.
std::optional<WholeNumbers> whole_numbers(std::span<const std::byte> samples, SampleType type);

// Stores samples of the type `from` as the type of their whole_numbers(). `target` may be where the
// samples are if their new type is not larger. Thread safe.
void store_whole(std::span<const std::byte> samples, SampleType from, SampleType to,
                 std::byte* target);

// Rounds floats of which a job by labels was asked. Throws Error kUnusableVolume with the first
// that is not nearly whole, or beyond 32 bits with a sign, and the way out. Returns true if one had
// to be rounded. Thread safe.
template <class Sample>
bool round_labels(std::span<const Sample> samples, std::int32_t* target);

// For labels that were stored as this type and had to be rounded.
Note rounded_note(SampleType stored);

// The number of distinct values if the volume looks like a label map; otherwise empty. A label map
// has at least two but few values, and most neighbours along x are equal, not counting pairs of
// background (the first sample's value). Floats must be nearly whole numbers (whole_numbers).
// `samples` as for measure(). Thread safe.
std::optional<std::size_t> label_count(std::span<const std::byte> samples, SampleType type,
                                       const std::array<std::uint32_t, 3>& dims);

// The distinct values, ascending; empty if there are more than `most`. Floats as for label_count().
// Thread safe.
std::optional<std::vector<std::int64_t>> distinct_values(std::span<const std::byte> samples,
                                                         SampleType type, std::size_t most);

// The share of neighbours along x that are equal, counted as for label_count(). Thread safe.
double share_of_equal_neighbours(std::span<const std::byte> samples, SampleType type,
                                 const std::array<std::uint32_t, 3>& dims);

// The value of a mask: each sample is nearly 0 or that whole number, which is larger. Empty for
// other volumes, also if all samples are equal. Two values around 0, or without it, do not say
// which one is outside. `range` and `samples` as in measure(), which found no non-finite sample.
// Thread safe.
std::optional<std::int64_t> mask_value(std::span<const std::byte> samples, SampleType type,
                                       const std::array<double, 2>& range);

// True if labels are valid as Volume::labels: few enough, ascending, with ascending values, short
// names without control characters, and valid colours. Thread safe.
bool is_label_table(std::span<const LabelEntry> labels);

}  // namespace isomesh::volume
