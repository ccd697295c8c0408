// Bytes as padded base64 (RFC 4648, section 4). Pure functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace isomesh {

std::string to_base64(std::span<const std::uint8_t> bytes);
std::string to_base64(std::string_view bytes);

// Writes the text at `out`, where there is room for it and a zero behind it. Returns where the text
// ends.
char* write_base64(std::span<const std::byte> bytes, char* out);

// The bytes; empty for anything but whole groups of four of its characters.
std::optional<std::string> from_base64(std::string_view text);

}  // namespace isomesh
