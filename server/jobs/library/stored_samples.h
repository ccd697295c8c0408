#pragma once

#include <stop_token>
#include <string>

#include "proto/error.h"
#include "server/store/blob_store.h"

namespace isomesh::jobs {

// Returns a volume's file after verifying its bytes against the volume's id. A mesh made from
// corrupted samples would not look wrong. Throws Error kUnusableVolume if the file is missing or
// corrupt, kCancelled if `stop` is requested. Thread safe.
store::LocalBlob stored_samples(const store::BlobStore& blobs, const std::string& volume,
                                const std::stop_token& stop = {});

// Runs `make`, in which a process works on a file of stored_samples(). If `make` fails with
// kInternal, verifies the blob again and throws kUnusableVolume if it is corrupt: a file truncated
// meanwhile kills the process or is no canonical volume any more.
template <class Make>
auto made_of_intact(const store::BlobStore& blobs, const std::string& volume,
                    const std::stop_token& stop, const Make& make) {
  try {
    return make();
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kInternal) stored_samples(blobs, volume, stop);
    throw;
  }
}

}  // namespace isomesh::jobs
