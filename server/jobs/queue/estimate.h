// What a job would take, told before it runs.
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
#include "server/jobs/library/memo.h"
#include "server/jobs/queue/pipeline.h"
#include "server/store/blob_store.h"
#include "server/store/job_store.h"
#include "server/store/volume_store.h"

namespace isomesh::jobs {

using mesh::SurfaceSize;

// How a job's time and files follow from its surface: the first guesses of stage_times.h and of the
// formats, corrected by finished jobs. Plain values.
class CostModel {
 public:
  // Takes a job that succeeded into account; `samples` is the size of its volume, and the spacing
  // its smallest. Jobs without a run of their own, whose stages took no time, change nothing.
  void learn(const Job& job, std::uint64_t samples, double spacing_mm);

  // What is left of a surface of which fewer triangles are asked for. A guess.
  SurfaceSize simplified(const SurfaceSize& surface, const MeshParameters& parameters,
                         double spacing_mm) const;

  // Load to certify, in milliseconds, without the queue: of a surface as it is extracted and as it
  // is written.
  double milliseconds(const SurfaceSize& surface, const SurfaceSize& written, std::uint64_t samples,
                      const JobParameters& parameters) const;

  // Of one file. Exact for STL.
  std::uint64_t file_bytes(MeshFormat format, const SurfaceSize& surface,
                           const MeshParameters& parameters) const;

 private:
  // Sums over the jobs that have finished: what was seen, and what the first guess for them was.
  // Their quotient corrects later guesses. Both sums begin above zero, so that one small job alone
  // changes the quotient little.
  struct Correction {
    double seen;
    double guessed;

    double factor() const { return seen / guessed; }
  };

  static constexpr Correction kFewMilliseconds = {20, 20};
  static constexpr Correction kFewTriangles = {100'000, 100'000};
  static constexpr Correction kFewBytes = {100'000, 100'000};

  std::vector<Correction> stages_ = std::vector(kStages.size(), kFewMilliseconds);
  Correction share_ = kFewTriangles;        // that simplification leaves
  std::map<MeshFormat, Correction> files_;  // kFewBytes for those that are not here
};

// Estimates jobs on stored volumes, whose surfaces a process of its own counts. Counts of the last
// surfaces are kept. Thread safe; what it is
// made of must outlive it.
class Estimator {
 public:
  Estimator(const store::VolumeStore& volumes, const store::BlobStore& blobs,
            const store::JobStore& jobs, const PipelineLimits& limits, const JobProgram& program)
      : volumes_(volumes), blobs_(blobs), jobs_(jobs), limits_(limits), process_(program) {}

  // Triangles and vertices are exact, before the filter of components; the rest follows from them
  // and from the jobs of the viewer's that are finished: those of others would tell of them. Throws
  // Error kNotFound without the volume, kUnusableVolume when the stored samples are damaged,
  // ProcessEnded, kUnavailable when too many wait for an estimate already or after stop().
  Estimate estimate(const store::Viewer& viewer, const JobParameters& parameters);

  // Ends the counting that is under way, for good.
  void stop() { stop_.request_stop(); }

 private:
  // Viewer (see Histograms), volume, iso-value or labels, scheme, whether it is closed.
  using Surface = std::tuple<store::Viewer, std::string, double, std::string, Scheme, bool>;

  static constexpr std::size_t kSurfaces = 1024;
  static constexpr std::size_t kMostWaiting = 12;

  CountedSurface count(const store::Viewer& viewer, const Volume& volume,
                       const MeshParameters& parameters, double iso);
  CostModel model(const store::Viewer& viewer) const;

  const store::VolumeStore& volumes_;
  const store::BlobStore& blobs_;
  const store::JobStore& jobs_;
  const PipelineLimits limits_;
  std::stop_source stop_;
  Mutex process_mutex_;
  JobProcess process_ ISOMESH_GUARDED_BY(process_mutex_);  // counts, one surface after the other
  Memo<Surface, CountedSurface> counts_{kSurfaces, kMostWaiting};
};

}  // namespace isomesh::jobs
