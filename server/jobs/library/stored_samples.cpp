#include "server/jobs/library/stored_samples.h"

#include "server/volume/unusable.h"

namespace isomesh::jobs {

store::LocalBlob stored_samples(const store::BlobStore& blobs, const std::string& volume,
                                const std::stop_token& stop) {
  if (store::is_there_and_intact(blobs, volume, stop)) return blobs.local(volume);
  volume::throw_damaged();
}

}  // namespace isomesh::jobs
