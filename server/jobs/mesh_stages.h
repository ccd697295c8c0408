// What the stages of a job at an iso-value and of one by labels have in common; private to this
// folder.
#pragma once

#include <atomic>
#include <cstddef>
#include <vector>

#include "proto/types.h"
#include "server/jobs/make_mesh.h"
#include "server/mesh/context.h"
#include "server/mesh/lattice.h"
#include "server/mesh/mesh.h"

namespace isomesh::jobs {

// The shares of a typical job that its stages take, for its progress.
inline constexpr double kExtractShare = 0.05;
inline constexpr double kSmoothShare = 0.08;
inline constexpr double kEncodeShare = 1 - kLoadShare - kExtractShare - kSmoothShare;

template <class T>
mesh::Lattice<T> lattice_of(const SampleArray& samples) {
  return {reinterpret_cast<const T*>(samples.bytes),
          {samples.dims[0], samples.dims[1], samples.dims[2]},
          mesh::lattice_to_space(samples.geometry)};
}

// Smooths the mesh, and says in the summary what that did and how good its triangles were before.
// Those after are set too, in case nothing is to be smoothed.
void smooth_stage(const MeshParameters& parameters, Progress& progress, mesh::Mesh& mesh,
                  MeshSummary& summary);

// How good the triangles are after smoothing; nothing to measure where there was none.
void measure_smoothed_shapes(const MeshParameters& parameters, const Progress& progress,
                             const mesh::Mesh& mesh, MeshQuality& quality);

// The progress of several that go on side by side, each an equal share of a stage. Outlives its
// contexts. Thread safe.
class SharedProgress {
 public:
  SharedProgress(const Progress& progress, std::size_t parts)
      : stage_(progress.context()), done_(parts) {}

  mesh::Context context(std::size_t part);

 private:
  const mesh::Context stage_;
  std::vector<std::atomic<double>> done_;
};

codec::Provenance provenance_of(const SampleArray& samples, const MeshRequest& request);

}  // namespace isomesh::jobs
