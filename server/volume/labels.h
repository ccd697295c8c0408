// Telling label maps from images, and what may be said of their labels.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "proto/types.h"

namespace isomesh::volume {

// How many values the samples of a volume have that looks like a label map: integers of at least
// three values, few of them, and mostly the same as the next sample along x wherever one of both is
// not background (the first sample's value). Empty for anything else; a mask of two values needs no
// labels. `samples` as for measure(). Thread safe.
std::optional<std::size_t> label_count(std::span<const std::byte> samples, SampleType type,
                                       const std::array<std::uint32_t, 3>& dims);

// Whether labels that are said to be a volume's are as Volume::labels has them: few enough,
// ascending, with values ascending, short names without control characters, and colours that are
// some. Thread safe.
bool is_label_table(std::span<const LabelEntry> labels);

}  // namespace isomesh::volume
