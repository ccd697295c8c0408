// Names of the objects in a bucket; see S3BlobStore.
#pragma once

#include <chrono>
#include <string>
#include <string_view>

#include "base/ids.h"

namespace isomesh::store {

inline constexpr const char* kMarkObject = "identity";
inline constexpr const char* kBlobObjects = "blobs/";
inline constexpr const char* kQuarantineObjects = "quarantine/";
inline constexpr const char* kHoldObjects = "holds/";
inline constexpr const char* kGoingObjects = "going/";

// A signed request is valid for 15 minutes by the peer's clock. So a daemon that announced an
// erasure this long ago can no longer erase.
inline constexpr std::chrono::minutes kLongestGoing{20};

inline std::string blob_object(const std::string& key) { return kBlobObjects + key; }
inline std::string quarantine_object(const std::string& key) { return kQuarantineObjects + key; }
inline std::string going_objects(const std::string& key) { return kGoingObjects + key + '/'; }
inline std::string hold_objects(const std::string& key) { return kHoldObjects + key + '/'; }
inline std::string going_object(const std::string& key) {
  return going_objects(key) + random_hex(8);
}
inline std::string hold_object(const std::string& key) { return hold_objects(key) + random_hex(8); }

// The key of the blob to which an object of these four kinds belongs.
inline std::string blob_of(std::string_view object) {
  object.remove_prefix(object.find('/') + 1);
  return std::string(object.substr(0, object.find('/')));
}

}  // namespace isomesh::store
