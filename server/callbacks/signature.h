// Signs callbacks as in the Standard Webhooks specification 1.0, so that its libraries can verify
// them: HMAC-SHA-256 over "ID.TIMESTAMP.BODY".
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "proto/error.h"

namespace isomesh::callbacks {

// Reads a file's keys, one per line. With several, each signs, so that a key can be replaced
// without interruption. A key is `whsec_` and base64, or the bytes of the line. Throws Error
// kInvalidParameter, without the key's text, for a file without a key or with a key of fewer than
// 24 bytes.
std::vector<std::string> read_callback_secrets(const std::filesystem::path& file);

// The value of the header webhook-signature. Throws Error kInternal.
std::string callback_signature(const std::vector<std::string>& secrets, std::string_view id,
                               std::int64_t timestamp, std::string_view body);

}  // namespace isomesh::callbacks
