// Bytes as base64 (RFC 4648), padded unless said otherwise. Pure functions.
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

// Writes the text and a terminating zero at `out`, which has room for both. Returns the end of the
// text.
char* write_base64(std::span<const std::byte> bytes, char* out);

// Returns empty unless `text` is whole groups of four base64 characters.
std::optional<std::string> from_base64(std::string_view text);

// The URL-safe form without padding (RFC 4648, section 5), as JSON Web Tokens have it. Returns
// empty unless `text` is the only such text for its bytes.
std::optional<std::string> from_base64url(std::string_view text);

}  // namespace isomesh
