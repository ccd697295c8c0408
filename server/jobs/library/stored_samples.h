#pragma once

#include <stop_token>
#include <string>

#include "proto/error.h"
#include "server/store/blob_store.h"

namespace isomesh::jobs {

// A volume's file, once its bytes are known to be those that its id names: what is made of samples
// that a disk has spoilt looks like any other. Throws Error kUnusableVolume when they are not, and
// kCancelled when `stop` is requested. Thread safe.
store::LocalBlob stored_samples(const store::BlobStore& blobs, const std::string& volume,
                                const std::stop_token& stop = {});

// What `make` returns, which has a process work on a file of stored_samples(). A file that was cut
// meanwhile ends the process, or is none of a volume any more; then the volume is told to be the
// reason, by kUnusableVolume.
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
