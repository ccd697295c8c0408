// The time of a job's stages: the one model behind estimates, progress, and the owners' turns in
// the queue. All functions are thread safe.
#pragma once

#include <cstdint>

#include "proto/types.h"
#include "server/mesh/extract/extract.h"

namespace isomesh::jobs {

// The properties of a volume that the times depend on.
struct VolumeSize {
  std::uint64_t samples = 0;
  double smallest_spacing_mm = 1;
  double largest_spacing_mm = 1;

  static VolumeSize of(const Volume& volume);
};

// The times of all stages of the job but the queue, in milliseconds. First guesses come from a head
// of 7.1 million voxels and five million triangles on two cores, and those of uneven spacing from
// labels. `extracted` and `written` are the sizes before and after simplification.
Timing stage_times(const mesh::SurfaceSize& extracted, const mesh::SurfaceSize& written,
                   const VolumeSize& volume, const MeshParameters& parameters,
                   const Measures& measures);

// The fraction of the triangles that simplification leaves within an error. A guess.
double share_within(double error_mm, double spacing_mm);

// The size after simplification. A guess; `correction` multiplies the fraction within an error.
mesh::SurfaceSize simplified_surface(const mesh::SurfaceSize& extracted,
                                     const MeshParameters& parameters, double spacing_mm,
                                     double correction = 1);

// The times of a job before any sample of its volume is read, for a surface of typical size.
Timing expected_times(const Volume& volume, const MeshParameters& parameters,
                      const Measures& measures);
// Their sum, in milliseconds.
double expected_ms(const Volume& volume, const JobParameters& parameters);

}  // namespace isomesh::jobs
