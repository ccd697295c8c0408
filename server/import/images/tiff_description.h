// Values in the descriptions of TIFF files.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace isomesh::import {

inline constexpr std::uint64_t kMostOfAKind = 1'000'000;

// The length of a unit in millimetres; empty for unknown units and for pixels.
std::optional<double> described_length(std::string_view unit);

// Empty if the text is no positive number.
std::optional<double> described_positive(std::string_view text);

// From 1 to kMostOfAKind, or else `otherwise`.
std::uint64_t described_count(std::string_view text, std::uint64_t otherwise);

}  // namespace isomesh::import
