// What making a mesh takes, as it follows from the size of its surface.
#pragma once

#include <cstdint>

#include "proto/types.h"
#include "server/jobs/making/make_mesh.h"
#include "server/mesh/extract/extract.h"
#include "server/mesh/smooth/smooth.h"

namespace isomesh::jobs {

// True if crossings are joined while the surface is extracted. A largest error is measured from the
// surface at an iso-value as it is without.
bool is_regularized(const MeshParameters& parameters);

// True if labels are smoothed by remove_stairs (server/mesh/stairs).
bool removes_stairs(const MeshParameters& parameters);

// For every other kind of smoothing.
mesh::SmoothOptions smooth_options(const MeshParameters& parameters);

// How much memory a job with a surface of that size, of so many samples, takes at its peak, beside
// its mapped volume: mesh, smoothing, encoders. An upper estimate.
// Simplifying and certifying take the most, where the job does so.
std::uint64_t estimate_memory(const mesh::SurfaceSize& surface, std::uint64_t samples,
                              const MeshParameters& parameters, bool certify);

// Throws Error kTooLarge with the estimate when that is more than is allowed.
void check_memory(const mesh::SurfaceSize& surface, std::uint64_t samples,
                  const MeshRequest& request);

// Throws Error kTooLarge when the files of a mesh could never have room. STL's size is known; of
// the others', which are guesses, half counts. To be asked of the mesh as it is written.
void check_disk(const mesh::Mesh& mesh, const MeshRequest& request);

}  // namespace isomesh::jobs
