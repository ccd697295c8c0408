// Makes a mesh: from the samples of a volume to the bytes of the files, without disks.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <stop_token>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/types.h"
#include "server/codec/encode.h"
#include "server/jobs/making/sample_array.h"
#include "server/mesh/extract/extract.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/mesh.h"
#include "server/mesh/spool.h"

namespace isomesh::jobs {

// Called during a job, from several threads, with the fraction of the whole job that is done and
// the milliseconds of the stages that have ended.
using Report = std::function<void(Stage stage, double progress, const Timing& timing)>;

// Follows a job through its stages: times each, reports progress, passes cancellation on.
class Progress {
 public:
  // A stage's share of the job is its share of the expected times; 0 if none is expected.
  Progress(std::stop_token stop, const Report& report, const Timing& expected);

  // Ends the previous stage and starts this one, with those that run at the same time.
  void enter(Stage stage, std::span<const Stage> meanwhile = {});
  // Shares out the time of the present stage so far, as the seconds of its threads say.
  using Seconds = std::pair<Stage, double>;
  void share_out(std::span<const Seconds> spent);
  void end_stage();

  // For the present stage.
  mesh::Context context() const {
    return {stop_, [this](double done) { report_(stage_, done_before_ + share_ * done, timing_); }};
  }

  // Cancels but does not report.
  mesh::Context quiet() const { return {stop_, nullptr}; }

  const Timing& timing() const { return timing_; }

 private:
  double elapsed_ms() const;

  std::stop_token stop_;
  const Report& report_;
  const Timing expected_;
  double expected_ms_ = 0;
  Timing timing_;
  Stage stage_ = Stage::kQueue;
  double done_before_ = 0;
  double share_ = 0;
  std::chrono::steady_clock::time_point began_;
};

// The memory in which jobs are made, kept between jobs so that its pages stay mapped. Not thread
// safe.
struct Workspace {
  mesh::Mesh mesh;                // of jobs at an iso-value
  mesh::SeparatingSurface walls;  // of jobs by labels

  // Frees the memory if it exceeds `budget_bytes`, so that one giant job does not keep it.
  void trim(std::size_t budget_bytes);
};

// The input of a mesh, and the resources it may use.
struct MeshRequest {
  const Volume& volume;  // its samples and notes, for the files to name
  const MeshParameters& parameters;
  double iso;  // resolved; the parameters may name none
  Measures measures;
  std::uint64_t memory_bytes;
  // For all files together, if the disk held nothing else.
  std::uint64_t disk_bytes = std::numeric_limits<std::uint64_t>::max();
  // For what would take much memory; null: it does.
  mesh::Spool* spool = nullptr;

  // The same with other parameters, which must outlive it.
  MeshRequest with(const MeshParameters& others) const {
    return {volume, others, iso, measures, memory_bytes, disk_bytes, spool};
  }
};

// The size of a surface that is not made yet.
struct CountedSurface {
  mesh::SurfaceSize size;
  std::vector<Estimate::Label> labels = {};  // of a job by labels
  std::uint64_t searching_bytes = 0;         // of memory, if the job looks for cavities

  // The sum over all labels' own surfaces.
  std::uint64_t triangles_of_labels() const {
    std::uint64_t sum = 0;
    for (const Estimate::Label& label : labels) sum += label.triangles;
    return sum;
  }
};

// The size of the surface before the filter of components. Throws Error kCancelled.
CountedSurface count_surface(const SampleArray& samples, const MeshRequest& request,
                             const mesh::Context& context);

// Extracts, smooths, simplifies, encodes, measures and certifies. `sinks` has one sink for each of
// the parameters' formats, in their order. The files of the summary are empty. `mesh` is working
// memory; afterwards it holds the mesh as it was encoded. `progress` enters the stages; the caller
// ends the last one, after storing the bytes. The parameters have no labels: see make_labels.h.
// Throws Error kCancelled, kInternal, and kTooLarge with the estimate if the job would exceed its
// memory (before it takes memory) or the size of the disk.
MeshSummary make_mesh(const SampleArray& samples, const MeshRequest& request,
                      std::span<const codec::Sink> sinks, Progress& progress, mesh::Mesh& mesh);

}  // namespace isomesh::jobs
