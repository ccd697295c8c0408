// What making a mesh takes, as it follows from the size of its surface.
#pragma once

#include <cstdint>

#include "proto/types.h"
#include "server/mesh/extract.h"
#include "server/mesh/smooth.h"

namespace isomesh::jobs {

mesh::SmoothOptions smooth_options(const MeshParameters& parameters);

// How much memory a job with a surface of that size takes at its peak, beside its mapped volume:
// mesh, smoothing, encoders. An upper estimate.
std::uint64_t estimate_memory(const mesh::SurfaceSize& surface, const MeshParameters& parameters);

// Throws Error kTooLarge with the estimate when that is more than is allowed.
void check_memory(const mesh::SurfaceSize& surface, const MeshParameters& parameters,
                  std::uint64_t allowed_bytes);

// Throws Error kTooLarge when the files of a surface of that size could never have room. STL's size
// is known; of the others', which are guesses, half counts.
void check_disk(const mesh::SurfaceSize& surface, const MeshParameters& parameters,
                std::uint64_t allowed_bytes);

}  // namespace isomesh::jobs
