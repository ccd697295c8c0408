#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "proto/types.h"
#include "server/jobs/memo.h"
#include "server/mesh/labels/labels.h"
#include "server/store/blob_store.h"
#include "server/store/job_store.h"

namespace isomesh::jobs {

// The values of the volume's labels that are not the samples of their own value alone.
LabelValues values_of(const Volume& volume);

// Which labels stored volumes have. The first list of a volume reads all of its samples; what the
// last kVolumes volumes have is kept for each viewer, as histograms are. Thread safe; `blobs` must
// outlive it.
class LabelLists {
 public:
  static constexpr std::size_t kVolumes = 16;  // 3 MB each at most
  static constexpr std::size_t kTexts = 4;     // some 20 MB each at most
  static constexpr std::size_t kMostWaiting = 12;

  explicit LabelLists(const store::BlobStore& blobs) : blobs_(blobs) {}

  // Samples of the value `background` belong to no label. Labels without a voxel are not listed.
  // Throws Error kUnusableVolume when the samples are not whole numbers, of more than
  // Volume::kMostLabels labels, or damaged, kUnavailable when too many wait for a list already,
  // kInternal.
  VolumeLabels of(const store::Viewer& viewer, const Volume& volume, std::int64_t background);

  // All values that the samples have, the background's too, ascending. Throws as `of` does.
  std::shared_ptr<const std::vector<mesh::LabelVoxels>> counts(const store::Viewer& viewer,
                                                               const Volume& volume);

  // The same as JSON, shared by all that send it, since it may be long.
  std::shared_ptr<const std::string> json_of(const store::Viewer& viewer, const Volume& volume,
                                             std::int64_t background);

 private:
  using Counts = std::vector<mesh::LabelVoxels>;

  const store::BlobStore& blobs_;
  Memo<std::pair<store::Viewer, std::string>, Counts> counts_{kVolumes, kMostWaiting};
  // By when the record was made, too: the same samples may come again with other names.
  Memo<std::tuple<store::Viewer, std::string, std::string, std::int64_t>, std::string> texts_{
      kTexts, kMostWaiting};
};

}  // namespace isomesh::jobs
