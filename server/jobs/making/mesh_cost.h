// The memory and disk space of making a mesh, from the size of its surface.
#pragma once

#include <cstdint>

#include "proto/types.h"
#include "server/jobs/making/make_mesh.h"
#include "server/mesh/extract/extract.h"
#include "server/mesh/smooth/smooth.h"
#include "server/mesh/walk/walk.h"

namespace isomesh::jobs {

// True if crossings are joined during extraction. With a largest error at an iso-value they are
// not, because it is measured from the surface of all crossings.
bool is_regularized(const MeshParameters& parameters);

// True if labels are smoothed by remove_stairs (server/mesh/stairs).
bool removes_stairs(const MeshParameters& parameters);

// For all other methods of smoothing.
mesh::SmoothOptions smooth_options(const MeshParameters& parameters);

// True if a job at an iso-value can be made window by window (server/mesh/walk): its files can be
// written as triangles come, and nothing else needs the surface as a whole.
bool can_be_walked(const MeshParameters& parameters, const Measures& measures);

// True if such a job is made so. A small surface would take longer, and a large one of few layers
// more memory: it is made as a whole, which gives the same.
bool is_walked(const mesh::SurfaceSize& surface, const MeshParameters& parameters,
               const Measures& measures);

// The options of that walk.
mesh::WalkOptions walk_options(mesh::SmoothOptions smooth, const MeshParameters& parameters,
                               const mesh::SurfaceSize& surface);

// True if a walk through so many samples sets things aside on the disk. Of few, they take less time
// in memory.
bool sets_aside(std::uint64_t samples);

// Memory that a job takes beside a surface.
struct MemoryUse {
  // Labels have two triangles for each of their walls together, or so many, if they overlap.
  std::uint64_t of_labels = 0;
  // The search for cavities, before the surface is smoothed or after it was walked through.
  std::uint64_t searching_bytes = 0;
  // Without a spool, jobs keep in memory what they would set aside.
  bool has_spool = true;
};

// An upper estimate of a job's peak memory beside its mapped volume: mesh, smoothing, encoders,
// simplifying and certifying. For a surface of that size in a volume of so many samples.
std::uint64_t estimate_memory(const mesh::SurfaceSize& surface, std::uint64_t samples,
                              const MeshParameters& parameters, const Measures& measures,
                              const MemoryUse& use = {});

// Throws Error kTooLarge with the estimate if that exceeds the limit. The request says whether
// there is a spool.
void check_memory(const mesh::SurfaceSize& surface, std::uint64_t samples,
                  const MeshRequest& request, MemoryUse use);

// Throws Error kTooLarge if the disk could never hold the files of the mesh. Half counts of sizes
// that are guesses. Call it with the size of the mesh that is written.
void check_disk(const mesh::SurfaceSize& surface, const MeshRequest& request);

}  // namespace isomesh::jobs
