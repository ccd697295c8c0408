// What the stages of a job at an iso-value and of one by labels have in common; private to this
// folder.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "proto/types.h"
#include "server/jobs/making/make_mesh.h"
#include "server/mesh/buffer.h"
#include "server/mesh/context.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/lattice/lattice.h"
#include "server/mesh/lattice/placement.h"
#include "server/mesh/measure/surface_view.h"
#include "server/mesh/measure/triangle_grid.h"
#include "server/mesh/mesh.h"
#include "server/mesh/smooth/smooth.h"

namespace isomesh::jobs {

// Whether the job asks for fewer triangles.
bool is_simplified(const MeshParameters& parameters);

template <class T>
mesh::Lattice<T> lattice_of(const SampleArray& samples) {
  return {reinterpret_cast<const T*>(samples.bytes),
          {samples.dims[0], samples.dims[1], samples.dims[2]},
          mesh::lattice_to_space(samples.geometry)};
}

mesh::ExtractOptions extract_options(const MeshParameters& parameters, double iso);

// The surface as it was extracted, for what is measured from it later. Empty where nothing is.
struct ExtractedSurface {
  std::vector<mesh::Vec3> positions;
  std::vector<mesh::Triangle> triangles;

  ExtractedSurface(const MeshRequest& request, const mesh::Mesh& mesh);

  mesh::SurfaceView view() const { return {positions, triangles}; }
};

// For files that hold distances: where the surface as it was extracted is, if any does.
std::optional<mesh::TriangleGrid> grid_for_distances(const MeshParameters& parameters,
                                                     const ExtractedSurface& extracted,
                                                     const Progress& progress);

// Smooths the mesh, and says in the summary what that did and how good its triangles were before.
// Those after are set too, in case nothing is to be smoothed.
void smooth_stage(const SampleArray& samples, const MeshRequest& request, Progress& progress,
                  mesh::Mesh& mesh, MeshSummary& summary);

// The same with another way to smooth the mesh.
using Smooth = std::function<mesh::SmoothingEffect(const mesh::Context&)>;
void smooth_stage(const Smooth& smooth, Progress& progress, const mesh::Mesh& mesh,
                  MeshSummary& summary);

// Where the parameters ask for it, leaves fewer triangles, and says in the summary how many there
// were and what has become of the surface. `walls` are whose mesh it is, if any. The parameters'
// bits are those that the files' coordinates will have. The distance is proven for every point
// where it can be (bound.h), and measured otherwise.
void simplify_stage(const SampleArray& samples, const MeshRequest& request,
                    const ExtractedSurface& extracted, Progress& progress, mesh::Mesh& mesh,
                    mesh::SeparatingSurface* walls, MeshSummary& summary);

// How good the triangles are after smoothing and simplification; nothing to measure where there was
// neither.
void measure_final_shapes(const MeshParameters& parameters, const Progress& progress,
                          const mesh::Mesh& mesh, MeshQuality& quality);

// Says how large the mesh is.
void set_size(const mesh::Mesh& mesh, MeshSummary& summary);

// Sets what follows from the other members: the genus, and whether volumes mean something.
void conclude_quality(MeshSummary& summary);

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
