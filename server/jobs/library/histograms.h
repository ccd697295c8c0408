#pragma once

#include <cstddef>
#include <string>
#include <utility>

#include "proto/types.h"
#include "server/jobs/library/memo.h"
#include "server/store/blob_store.h"
#include "server/store/job_store.h"
#include "server/volume/histogram.h"

namespace isomesh::jobs {

// Histograms of stored volumes. The first one of a volume reads all of its samples; the counts of
// the last kVolumes volumes are kept, so that others of any width cost nothing. They are kept for
// each viewer: a quick answer would tell that somebody else has the same volume. Thread safe;
// `blobs` must outlive it.
class Histograms {
 public:
  static constexpr std::size_t kVolumes = 32;  // half a megabyte each at most
  static constexpr std::size_t kMostWaiting = 12;

  explicit Histograms(const store::BlobStore& blobs) : blobs_(blobs) {}

  // Throws Error kUnavailable when too many wait for one already, kUnusableVolume when the
  // stored samples are damaged, kInternal.
  Histogram of(const store::Viewer& viewer, const Volume& volume, std::size_t bins);

 private:
  const store::BlobStore& blobs_;
  Memo<std::pair<store::Viewer, std::string>, volume::ValueCounts> counts_{kVolumes, kMostWaiting};
};

}  // namespace isomesh::jobs
