// The memory and disk space of making a mesh, from the size of its surface.
#pragma once

#include <cstdint>

#include "proto/types.h"
#include "server/jobs/making/make_mesh.h"
#include "server/mesh/extract/extract.h"
#include "server/mesh/smooth/smooth.h"

namespace isomesh::jobs {

// True if crossings are joined during extraction. With a largest error at an iso-value they are
// not, because it is measured from the surface of all crossings.
bool is_regularized(const MeshParameters& parameters);

// True if labels are smoothed by remove_stairs (server/mesh/stairs).
bool removes_stairs(const MeshParameters& parameters);

// For all other methods of smoothing.
mesh::SmoothOptions smooth_options(const MeshParameters& parameters);

// True if a job at an iso-value is made window by window (server/mesh/walk): its files can be
// written as triangles come, and nothing else needs the surface as a whole.
bool is_walked(const MeshParameters& parameters, bool certify);

// An upper estimate of a job's peak memory beside its mapped volume: mesh, smoothing, encoders,
// simplifying and certifying. For a surface of that size in a volume of so many samples.
std::uint64_t estimate_memory(const mesh::SurfaceSize& surface, std::uint64_t samples,
                              const MeshParameters& parameters, bool certify);

// Throws Error kTooLarge with the estimate if that exceeds the limit.
void check_memory(const mesh::SurfaceSize& surface, std::uint64_t samples,
                  const MeshRequest& request);

// Throws Error kTooLarge if the disk could never hold the files of the mesh. Half counts of sizes
// that are guesses. Call it with the size of the mesh that is written.
void check_disk(const mesh::SurfaceSize& surface, const MeshRequest& request);

}  // namespace isomesh::jobs
