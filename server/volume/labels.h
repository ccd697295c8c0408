// Recognises label maps and validates their labels.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "proto/types.h"

namespace isomesh::volume {

// The smallest integer type that represents all samples; empty if there is none. `samples` as for
// measure(). Thread safe.
std::optional<SampleType> whole_type(std::span<const std::byte> samples, SampleType type);

// The number of distinct values if the volume looks like a label map; otherwise empty. A label map
// has whole numbers of at least three but few values, and most neighbours along x are equal, not
// counting pairs of background (the first sample's value). mask_value() recognises two values.
// `samples` as for measure(). Thread safe.
std::optional<std::size_t> label_count(std::span<const std::byte> samples, SampleType type,
                                       const std::array<std::uint32_t, 3>& dims);

// The value of a mask: each sample is 0 or that whole number, which is larger. Empty for other
// volumes, also if all samples are equal. Two values around 0, or without it, do not say which one
// is outside. `range` and `samples` as in measure(), which found no non-finite sample. Thread safe.
std::optional<std::int64_t> mask_value(std::span<const std::byte> samples, SampleType type,
                                       const std::array<double, 2>& range);

// True if labels are valid as Volume::labels: few enough, ascending, with ascending values, short
// names without control characters, and valid colours. Thread safe.
bool is_label_table(std::span<const LabelEntry> labels);

}  // namespace isomesh::volume
