// The common stages of jobs at an iso-value and by labels; private to this folder.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "proto/types.h"
#include "server/jobs/making/make_mesh.h"
#include "server/jobs/making/sample_array.h"
#include "server/mesh/buffer.h"
#include "server/mesh/context.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/lattice/lattice.h"
#include "server/mesh/lattice/placement.h"
#include "server/mesh/measure/shapes.h"
#include "server/mesh/measure/surface_view.h"
#include "server/mesh/measure/triangle_grid.h"
#include "server/mesh/mesh.h"
#include "server/mesh/smooth/smooth.h"
#include "server/mesh/topology/topology.h"

namespace isomesh::jobs {

mesh::ExtractOptions extract_options(const MeshParameters& parameters, double iso);

// A copy of a surface, which later stages change; empty if nothing needs it.
struct KeptSurface {
  std::vector<mesh::Vec3> positions;
  std::vector<mesh::Triangle> triangles;

  mesh::SurfaceView view() const { return {positions, triangles}; }
};

// The extracted surface, if something is measured from it. Only the positions if vertices move back
// to them (untangle_stage), and no more.
KeptSurface kept_extracted(const MeshRequest& request, const mesh::Mesh& mesh);

// The smoothed and untangled surface, if the error is measured from it.
KeptSurface kept_smoothed(const MeshRequest& request, const mesh::Mesh& mesh);

// The extracted surface for files that hold distances; empty if none does.
std::optional<mesh::TriangleGrid> grid_for_distances(const MeshParameters& parameters,
                                                     const KeptSurface& extracted,
                                                     const Progress& progress);

// Smooths the mesh. Writes the effect and the quality of the triangles before into the summary, and
// the same quality as the final one in case no other stage changes it.
void smooth_stage(const SampleArray& samples, const MeshRequest& request, Progress& progress,
                  mesh::Mesh& mesh, MeshSummary& summary);

// The options of smooth_stage.
mesh::SmoothOptions smoothing_of(const SampleArray& samples, const MeshParameters& parameters);

// Writes the effect of smoothing, and the shapes before, into the summary; those also as the final
// ones.
void set_smoothing(const mesh::Shapes& extracted, const mesh::SmoothingEffect& effect,
                   MeshSummary& summary);
void set_final(const mesh::Shapes& shapes, MeshQuality& quality);
void set_topology(const mesh::Topology& topology, MeshSummary& summary);

// Uses another function for smoothing.
using Smooth = std::function<mesh::SmoothingEffect(const mesh::Context&)>;
void smooth_stage(const Smooth& smooth, Progress& progress, const mesh::Mesh& mesh,
                  MeshSummary& summary);

// Moves vertices back towards their extracted positions until the smoothed mesh does not intersect
// itself, if the parameters ask for it, and writes the result into the summary. Frees the extracted
// positions if nothing is measured from them.
void untangle_stage(const MeshParameters& parameters, KeptSurface& extracted, Progress& progress,
                    mesh::Mesh& mesh, MeshSummary& summary);

// Simplifies the mesh if the parameters ask for it, and writes the result into the summary. `walls`
// is the owner of the mesh, if it has one. The parameters have the bits of the files' coordinates.
// The distance from the surface that error_reference() names is proven for every point if possible
// (bound.h), and measured otherwise.
void simplify_stage(const SampleArray& samples, const MeshRequest& request,
                    const KeptSurface& extracted, Progress& progress, mesh::Mesh& mesh,
                    mesh::SeparatingSurface* walls, MeshSummary& summary);

// Measures the triangles after smoothing and simplification, unless there was neither.
void measure_final_shapes(const MeshParameters& parameters, const Progress& progress,
                          const mesh::Mesh& mesh, MeshQuality& quality);

// Measures how thick the walls are, if the job asks for it: those of each of so many closed
// surfaces, which `surface` makes.
using MakeSurface = std::function<const mesh::Mesh&(std::size_t number)>;
void thickness_stage(const MeshRequest& request, std::size_t surfaces, const MakeSurface& surface,
                     Progress& progress, MeshSummary& summary);

// Writes the size of the mesh into the summary.
mesh::SurfaceSize size_of(const mesh::Mesh& mesh);
void set_size(const mesh::SurfaceSize& surface, MeshSummary& summary);

// Sets what follows from other members: the genus, and whether volumes are meaningful.
void conclude_quality(MeshSummary& summary);

// The progress of parallel tasks, each an equal part of a stage. Must outlive its contexts. Thread
// safe.
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
