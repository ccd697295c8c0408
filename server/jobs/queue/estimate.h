// Estimates the time and the files of a job before it runs.
#pragma once

#include <cstdint>
#include <map>
#include <stop_token>
#include <string>
#include <tuple>
#include <vector>

#include "base/mutex.h"
#include "proto/stages.h"
#include "proto/types.h"
#include "server/jobs/library/cache.h"
#include "server/jobs/limits.h"
#include "server/jobs/making/stage_times.h"
#include "server/jobs/queue/pipeline.h"
#include "server/store/blob_store.h"
#include "server/store/job_store.h"
#include "server/store/volume_store.h"

namespace isomesh::jobs {

using mesh::SurfaceSize;

// Predicts a job's time and file sizes from the size of its surface. Starts from the initial
// guesses of stage_times.h and of the formats, and corrects them from finished jobs. Not thread
// safe.
class CostModel {
 public:
  // Learns from a successful job on that volume. Ignores jobs that took their result from another
  // job: their stages have no times.
  void learn(const Job& job, const VolumeSize& volume);

  // The predicted size of the surface after simplification.
  SurfaceSize simplified(const SurfaceSize& surface, const MeshParameters& parameters,
                         double spacing_mm) const;

  // Predicted milliseconds from loading to certifying, without the time in the queue. `surface` is
  // the extracted surface, `written` the one in the files.
  double milliseconds(const SurfaceSize& surface, const SurfaceSize& written,
                      const VolumeSize& volume, const JobParameters& parameters) const;

  // The predicted size of one file. Exact for STL.
  std::uint64_t file_bytes(MeshFormat format, const SurfaceSize& surface,
                           const MeshParameters& parameters) const;

 private:
  // Sums over finished jobs: the observed values and the initial guesses. Their quotient corrects
  // later guesses. Both sums start above zero, so that a single small job has little effect.
  struct Correction {
    double seen;
    double guessed;

    double factor() const { return seen / guessed; }
  };

  static constexpr Correction kFewMilliseconds = {20, 20};
  static constexpr Correction kFewTriangles = {100'000, 100'000};
  static constexpr Correction kFewBytes = {100'000, 100'000};

  std::vector<Correction> stages_ = std::vector(kStages.size(), kFewMilliseconds);
  Correction share_ = kFewTriangles;        // fraction that simplification keeps
  std::map<MeshFormat, Correction> files_;  // kFewBytes for missing formats
};

// Estimates jobs on stored volumes. A process of its own counts the surface. The counts of recent
// surfaces are cached. Thread safe; its dependencies must outlive it.
class Estimator {
 public:
  Estimator(const store::VolumeStore& volumes, const store::BlobStore& blobs,
            const store::JobStore& jobs, const PipelineLimits& limits, const JobProgram& program)
      : volumes_(volumes), blobs_(blobs), jobs_(jobs), limits_(limits), process_(program) {}

  // Triangles and vertices are exact, before components are filtered. The rest is predicted from
  // them and from the viewer's own finished jobs; those of others would reveal facts about them.
  // Throws Error kNotFound without the volume, kUnusableVolume if the stored samples are damaged,
  // ProcessEnded, kUnavailable if too many callers wait already or after stop().
  Estimate estimate(const store::Viewer& viewer, const JobParameters& parameters);

  // Aborts the current count and all later ones.
  void stop() { stop_.request_stop(); }

 private:
  // Viewer (see Histograms), volume, iso-value, key of the other parameters, scheme, whether it is
  // closed.
  using Surface = std::tuple<store::Viewer, std::string, double, std::string, Scheme, bool>;

  CountedSurface count(const store::Viewer& viewer, const Volume& volume,
                       const MeshParameters& parameters, double iso);
  CostModel model(const store::Viewer& viewer) const;

  const store::VolumeStore& volumes_;
  const store::BlobStore& blobs_;
  const store::JobStore& jobs_;
  const PipelineLimits limits_;
  std::stop_source stop_;
  Mutex process_mutex_;
  JobProcess process_ ISOMESH_GUARDED_BY(process_mutex_);  // counts one surface at a time
  Cache<Surface, CountedSurface> counts_{limits::kSurfaceCounts, limits::kMostWaitingForAnswers};
};

}  // namespace isomesh::jobs
