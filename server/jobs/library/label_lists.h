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
#include "server/jobs/library/cache.h"
#include "server/jobs/limits.h"
#include "server/mesh/labels/label_voxels.h"
#include "server/store/blob_store.h"
#include "server/store/job_store.h"

namespace isomesh::jobs {

// Lists the labels in stored volumes. The first list of a volume reads all samples. The results of
// the last volumes are cached for each viewer, for the reason given at Histograms. Thread
// safe; `blobs` must outlive it.
class LabelLists {
 public:
  explicit LabelLists(const store::BlobStore& blobs) : blobs_(blobs) {}

  // Samples of the value `background` belong to no label. Labels without voxels are omitted. Floats
  // that are nearly whole numbers count as these. Throws Error kUnusableVolume if the samples are
  // damaged, not whole numbers (naming one), or have more than Volume::kMostLabels labels;
  // kUnavailable if too many callers wait already; kInternal otherwise.
  VolumeLabels of(const store::Viewer& viewer, const Volume& volume, std::int64_t background);

  // All distinct values of the samples with their voxels, ascending, including the background.
  // Throws as of() does.
  std::shared_ptr<const std::vector<mesh::LabelVoxels>> counts(const store::Viewer& viewer,
                                                               const Volume& volume);

  // The first labels of that list after the label `after`, at most MeshSummary::kMostListedLabels
  // of them. If more follow, `next` is the last label of the page as text.
  VolumeLabels page_of(const store::Viewer& viewer, const Volume& volume, std::int64_t background,
                       std::optional<std::int64_t> after);

 private:
  using Counts = std::vector<mesh::LabelVoxels>;

  const store::BlobStore& blobs_;
  Cache<std::pair<store::Viewer, std::string>, Counts> counts_{limits::kLabelCounts,
                                                               limits::kMostWaitingForAnswers};
  Cache<std::tuple<store::Viewer, std::string, std::int64_t>, VolumeLabels> lists_{
      limits::kLabelLists, limits::kMostWaitingForAnswers};
};

}  // namespace isomesh::jobs
