#pragma once

#include <chrono>
#include <string>
#include <string_view>

#include "server/store/blob_store.h"
#include "server/store/s3/address.h"

namespace isomesh::store {

// Escapes all but letters, digits and "-._~" as %XX.
std::string uri_escaped(std::string_view text);

// A presigned URL at which anybody can fetch the object from now on, for the time in `as` (AWS
// Signature Version 4 in the query). `key` includes the prefix.
std::string presigned_url(const S3Address& address, const S3Credentials& credentials,
                          const std::string& key, const LinkedAs& as,
                          std::chrono::system_clock::time_point from);

}  // namespace isomesh::store
