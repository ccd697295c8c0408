#pragma once

#include <chrono>
#include <string>
#include <string_view>

#include "server/store/blob_store.h"
#include "server/store/s3/address.h"

namespace isomesh::store {

// As it stands in a query: all but letters, digits and "-._~" as %XX.
std::string uri_escaped(std::string_view text);

// The address under which anybody gets an object, from then on for as long as `as` says (AWS
// Signature Version 4, in the query). `key` is the whole one, with the prefix.
std::string presigned_url(const S3Address& address, const S3Credentials& credentials,
                          const std::string& key, const LinkedAs& as,
                          std::chrono::system_clock::time_point from);

}  // namespace isomesh::store
