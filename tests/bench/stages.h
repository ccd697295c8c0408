// Every call of the benchmarks into the kernels, the encoder and the job's way through them. What
// changes there is followed here and nowhere else.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "proto/types.h"
#include "server/jobs/making/make_mesh.h"
#include "server/mesh/mesh.h"
#include "server/mesh/smooth/smooth.h"
#include "tests/bench/samples.h"

namespace isomesh::bench {

inline std::string_view name_of(Scheme scheme) {
  return to_string(SchemeName{static_cast<int>(scheme)});
}

// The surface of a volume that is measured.
struct Surface {
  double iso = 0;
  Scheme scheme = Scheme::kSix;
  Interpolation interpolation = Interpolation::kLinear;
  bool close = false;
  bool regularize = false;
};

struct MeshSize {
  std::uint64_t vertices = 0;
  std::uint64_t triangles = 0;
};

// The answer of a job.
struct JobFigures {
  MeshSummary mesh;
  Timing timing;
  std::uint64_t bytes = 0;  // of all files
};

// A job's work from the samples in memory to the bytes of its files. run_job() only counts the
// bytes.
using MakeJob = std::function<MeshSummary(const jobs::SampleArray&, const jobs::MeshRequest&,
                                          std::span<const codec::Sink>, jobs::Progress&)>;
JobFigures run_job(const Samples& samples, const MeshParameters& parameters, double iso,
                   const Measures& measures, const MakeJob& make);

// Threads that the stages run on, 1 at least. Not while one runs.
void set_threads(int threads);

// As a job by labels has them that asks for Laplacian smoothing and for nothing else.
mesh::SmoothOptions laplacian_by_labels(const Samples& samples);

// One volume's way through the stages, in memory that is kept from run to run as a worker of the
// daemon keeps it. Extract comes first; the others take whatever mesh there is. Not thread safe.
// Keeps a reference to the samples.
class Stages {
 public:
  Stages(const Samples& samples, const Surface& surface) : samples_(samples), surface_(surface) {}

  MeshSize count() const;
  void extract();  // counts first
  // With area, volume and bounds before and after, as a job has it; the other parameters are those
  // of a job that gives none.
  void smooth(int passes, Smoothing smoothing = Smoothing::kLaplacian);

  // The memory that smoothing says it needs beside the mesh, in bytes.
  std::uint64_t smoothing_memory(int passes) const;
  void measure_topology() const;
  // The number of bytes.
  std::uint64_t encode(MeshFormat format, const MeshParameters& parameters = {}) const;
  // A `drc` file with the parameters of a job that gives none.
  std::string drc() const;
  // Runs a job from the samples in memory to the bytes of its files, without the disk. The surface
  // is this one's, whatever the parameters say.
  JobFigures run_job(const MeshParameters& parameters, bool certify = false);

  // Gives the memory back to the system, so that the next run meets pages that are not mapped.
  void release_memory();

  MeshSize size() const;
  double volume_mm3() const;
  std::span<const mesh::Vec3> positions() const { return mesh_.positions.span(); }
  std::span<const mesh::Triangle> triangles() const { return mesh_.triangles.span(); }
  const mesh::Mesh& mesh() const { return mesh_; }
  // The memory of the mesh alone.
  std::uint64_t mesh_bytes() const;

 private:
  const Samples& samples_;
  Surface surface_;
  mesh::Mesh mesh_;
};

// Passes and a format; all else as a job has it that gives nothing.
MeshParameters job_to(MeshFormat format, int passes);

}  // namespace isomesh::bench
