#pragma once

#include <stop_token>
#include <string>

#include "proto/error.h"
#include "server/store/blob_store.h"
#include "server/volume/unusable.h"

namespace isomesh::jobs {

// Returns the file of samples with that digest (Volume::samples) after verifying its bytes. A mesh
// made from corrupted samples would not look wrong. Throws Error kUnusableVolume if the file is
// missing or corrupt, kCancelled if `stop` is requested. Thread safe.
inline store::LocalBlob intact_volume(const store::BlobStore& blobs, const std::string& samples,
                                      const std::stop_token& stop = {}) {
  if (store::is_there_and_intact(blobs, samples, stop)) return blobs.local(samples);
  volume::throw_damaged();
}

// Runs `make`, in which a process works on a file of intact_volume(). If `make` fails with
// kInternal or kNotFound, verifies the blob again and throws kUnusableVolume if it is corrupt: a
// file truncated meanwhile kills the process or is no canonical volume any more. A file that was
// missing only for a moment is kUnavailable.
template <class Make>
auto make_from_volume(const store::BlobStore& blobs, const std::string& samples,
                      const std::stop_token& stop, const Make& make) {
  try {
    return make();
  } catch (const Error& error) {
    const bool was_missing = error.code() == ErrorCode::kNotFound;
    if (was_missing || error.code() == ErrorCode::kInternal) intact_volume(blobs, samples, stop);
    if (!was_missing) throw;
    throw Error(ErrorCode::kUnavailable, "the volume's file was missing for a moment: try again");
  }
}

}  // namespace isomesh::jobs
