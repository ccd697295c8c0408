// Labels as files describe them -> Volume::labels.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/types.h"

namespace isomesh::import {

// A valid label name: UTF-8 without control characters, truncated to the limit.
std::string label_name(std::string_view text);

// Red, green and blue, clamped to 0..1, as "#rrggbb"; empty for non-finite numbers.
std::optional<std::string> label_color(const std::array<double, 3>& parts);

// Sorts the entries; of several for one label the first is used. Throws Error kUnusableVolume if
// there are more than Volume::kMostLabels, or if names and values exceed 4 MiB.
std::vector<LabelEntry> label_table(std::vector<LabelEntry> entries);

}  // namespace isomesh::import
