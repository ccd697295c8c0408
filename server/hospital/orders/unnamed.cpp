#include "server/hospital/orders/unnamed.h"

#include <exception>

#include "base/log.h"

namespace isomesh::orders {

void erase_unnamed(store::BlobStore& blobs, const store::VolumeStore& volumes,
                   std::vector<std::string> keys, const std::vector<std::string>& stored) {
  try {
    for (const std::string& key : stored) {
      blobs.mark_named(key);
      keys.push_back(key);
    }
    blobs.erase_unnamed(keys, {}, [&](const std::string& key) { return volumes.names(key); });
  } catch (const std::exception& error) {
    log_error("files of patients could not be erased and are removed later: {}", error.what());
  }
}

}  // namespace isomesh::orders
