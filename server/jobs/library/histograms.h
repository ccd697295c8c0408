#pragma once

#include <cstddef>
#include <string>
#include <utility>

#include "proto/types.h"
#include "server/jobs/library/cache.h"
#include "server/jobs/limits.h"
#include "server/store/blob_store.h"
#include "server/store/job_store.h"
#include "server/volume/histogram.h"

namespace isomesh::jobs {

// Histograms of stored volumes. The first histogram of a volume reads all samples. The counts of
// the last volumes are cached, so further histograms with any number of bins are fast. The
// cache is separate for each viewer: otherwise a fast response would reveal that somebody else has
// the same volume. Thread safe; `blobs` must outlive it.
class Histograms {
 public:
  explicit Histograms(const store::BlobStore& blobs) : blobs_(blobs) {}

  // Throws Error kUnavailable if too many callers wait already, kUnusableVolume if the stored
  // samples are damaged, kInternal otherwise.
  Histogram of(const store::Viewer& viewer, const Volume& volume, std::size_t bins);

 private:
  const store::BlobStore& blobs_;
  Cache<std::pair<store::Viewer, std::string>, volume::ValueCounts> counts_{
      limits::kHistograms, limits::kMostWaitingForAnswers};
};

}  // namespace isomesh::jobs
