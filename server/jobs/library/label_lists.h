#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "proto/types.h"
#include "server/jobs/library/memo.h"
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
  static constexpr std::size_t kLists = 4;     // some 10 MB each at most
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

  // The first labels of that list after the label `after`, at most MeshSummary::kMostListedLabels
  // of them. Its `next` is the last of them, as a text, if there are more.
  VolumeLabels page_of(const store::Viewer& viewer, const Volume& volume, std::int64_t background,
                       std::optional<std::int64_t> after);

 private:
  using Counts = std::vector<mesh::LabelVoxels>;

  const store::BlobStore& blobs_;
  Memo<std::pair<store::Viewer, std::string>, Counts> counts_{kVolumes, kMostWaiting};
  // By when the record was made, too: the same samples may come again with other names.
  Memo<std::tuple<store::Viewer, std::string, std::string, std::int64_t>, VolumeLabels> lists_{
      kLists, kMostWaiting};
};

}  // namespace isomesh::jobs
