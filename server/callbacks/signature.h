// Signatures of callbacks, as the Standard Webhooks specification 1.0 makes them, so that its
// libraries can check them: HMAC-SHA-256 over "ID.TIMESTAMP.BODY".
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "proto/error.h"

namespace isomesh::callbacks {

// The keys of a file, one a line; with several, each signs, so that a key can be replaced without a
// gap. `whsec_` and base64, or the bytes of the line as they are. Throws Error kInvalidParameter
// for a file without a key, or with one of fewer than 24 bytes; never with its text.
std::vector<std::string> read_callback_secrets(const std::filesystem::path& file);

// The value of the header webhook-signature. Throws Error kInternal.
std::string callback_signature(const std::vector<std::string>& secrets, std::string_view id,
                               std::int64_t timestamp, std::string_view body);

}  // namespace isomesh::callbacks
