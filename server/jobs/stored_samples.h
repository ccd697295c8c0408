#pragma once

#include <stop_token>
#include <string>

#include "server/store/blob_store.h"

namespace isomesh::jobs {

// A volume's file, once its bytes are known to be those that its id names: what is made of samples
// that a disk has spoilt looks like any other. Throws Error kUnusableVolume when they are not, and
// kCancelled when `stop` is requested. Thread safe.
store::LocalBlob stored_samples(const store::BlobStore& blobs, const std::string& volume,
                                const std::stop_token& stop = {});

}  // namespace isomesh::jobs
