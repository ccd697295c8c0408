#pragma once

#include <cstddef>
#include <string>
#include <utility>

#include "proto/types.h"
#include "server/jobs/library/cache.h"
#include "server/store/blob_store.h"
#include "server/store/job_store.h"
#include "server/volume/histogram.h"

namespace isomesh::jobs {

// Histograms of stored volumes. The first histogram of a volume reads all samples. The counts of
// the last kVolumes volumes are cached, so further histograms with any number of bins are fast. The
// cache is separate for each viewer: otherwise a fast response would reveal that somebody else has
// the same volume. Thread safe; `blobs` must outlive it.
class Histograms {
 public:
  static constexpr std::size_t kVolumes = 32;  // at most half a megabyte each
  static constexpr std::size_t kMostWaiting = 12;

  explicit Histograms(const store::BlobStore& blobs) : blobs_(blobs) {}

  // Throws Error kUnavailable if too many callers wait already, kUnusableVolume if the stored
  // samples are damaged, kInternal otherwise.
  Histogram of(const store::Viewer& viewer, const Volume& volume, std::size_t bins);

 private:
  const store::BlobStore& blobs_;
  Cache<std::pair<store::Viewer, std::string>, volume::ValueCounts> counts_{kVolumes, kMostWaiting};
};

}  // namespace isomesh::jobs
