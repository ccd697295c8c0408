// What files say of their labels -> Volume::labels.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/types.h"

namespace isomesh::import {

// A name as a label may have it: UTF-8 without control characters, cut where it is too long.
std::string label_name(std::string_view text);

// Red, green and blue, 0..1 or clamped to that, as "#rrggbb"; empty for numbers that are not
// finite.
std::optional<std::string> label_color(const std::array<double, 3>& parts);

// Ascending, each label once, as the first of several entries has it. Throws Error kUnusableVolume
// when there are more than Volume::kMostLabels, or their names and values are more than megabytes.
std::vector<LabelEntry> label_table(std::vector<LabelEntry> entries);

}  // namespace isomesh::import
