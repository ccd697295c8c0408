// What a job does between the samples of its volume and the bytes of its files, without disks.
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
#include <vector>

#include "proto/types.h"
#include "server/codec/encode.h"
#include "server/mesh/extract/extract.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/mesh.h"

namespace isomesh::jobs {

// Called as a job goes on, from several threads, with the share of the whole job that is done and
// the milliseconds of the stages that have ended.
using Report = std::function<void(Stage stage, double progress, const Timing& timing)>;

// Follows a job through its stages: times each, reports its progress, passes cancellation on.
class Progress {
 public:
  // A stage's share of the job is its share of the expected times; 0 if none is expected.
  Progress(std::stop_token stop, const Report& report, const Timing& expected);

  // Ends the stage before and starts this one.
  void enter(Stage stage);
  void end_stage();

  // The context of the part [from, to] of the present stage.
  mesh::Context context(double from = 0, double to = 1) const {
    return {stop_, [this, from, to](double done) {
              report_(stage_, done_before_ + share_ * (from + (to - from) * done), timing_);
            }};
  }

  // One that cancels but does not report.
  mesh::Context quiet() const { return {stop_, nullptr}; }

  const Timing& timing() const { return timing_; }

 private:
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

// The memory that jobs are made in, kept from one to the next so that its pages are mapped already.
// Not thread safe.
struct Workspace {
  mesh::Mesh mesh;                // of jobs at an iso-value
  mesh::SeparatingSurface walls;  // of jobs by labels

  // Gives memory back when it exceeds `budget_bytes`: one giant job must not keep it for ever.
  void trim(std::size_t budget_bytes);
};

// A volume in memory, as Volume describes it.
struct SampleArray {
  SampleType type = SampleType::kUint8;
  std::array<std::uint32_t, 3> dims = {0, 0, 0};
  Geometry geometry;
  const std::byte* bytes = nullptr;
};

// What a mesh is to be made of and what it may take.
struct MeshRequest {
  const Volume& volume;  // its id and notes, for the files to name
  const MeshParameters& parameters;
  double iso;  // whatever the parameters say of it
  bool certify;
  std::uint64_t memory_bytes;
  // Of all files together; the disk may hold other things now, but never more than that.
  std::uint64_t disk_bytes = std::numeric_limits<std::uint64_t>::max();

  // The same with other parameters, which must outlive it.
  MeshRequest with(const MeshParameters& others) const {
    return {volume, others, iso, certify, memory_bytes, disk_bytes};
  }
};

// How large a surface would be.
struct CountedSurface {
  mesh::SurfaceSize size;
  std::vector<Estimate::Label> labels = {};  // of a job by labels
};

// How large the surface is, before the filter of components. Throws Error kCancelled.
mesh::SurfaceSize count_surface(const SampleArray& samples, const MeshParameters& parameters,
                                double iso, const mesh::Context& context);

// Extracts, smooths, simplifies, encodes, measures and certifies; `sinks` has one for each of the
// parameters' formats, in their order. The files of the summary are empty. `mesh` is worked in, and
// left as it was encoded. `progress` enters the stages; the caller ends the last one, when the
// bytes are where they belong. The parameters have no labels: see make_labels.h. Throws Error
// kCancelled, kTooLarge with the estimate when the job would take more than it may (told before
// memory is taken) or than the disk could ever hold, and kInternal.
MeshSummary make_mesh(const SampleArray& samples, const MeshRequest& request,
                      std::span<const codec::Sink> sinks, Progress& progress, mesh::Mesh& mesh);

}  // namespace isomesh::jobs
