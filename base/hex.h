// Bytes as lower-case hexadecimal digits, two per byte. Pure functions.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace isomesh {

std::string to_hex(std::span<const std::uint8_t> bytes);
std::string to_hex(std::string_view bytes);

// Returns empty unless `digits` is pairs of lower-case digits.
std::optional<std::string> from_hex(std::string_view digits);

}  // namespace isomesh
