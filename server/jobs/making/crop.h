// The part of a volume that a job uses.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "proto/types.h"
#include "server/jobs/making/sample_array.h"
#include "server/mesh/buffer.h"

namespace isomesh::jobs {

// Samples [begin, end) along each axis.
struct SampleRange {
  std::array<std::uint32_t, 3> begin = {0, 0, 0};
  std::array<std::uint32_t, 3> end = {0, 0, 0};

  std::uint64_t count() const {
    return std::uint64_t{end[0] - begin[0]} * (end[1] - begin[1]) * (end[2] - begin[2]);
  }
};

// The samples in the box; for an oblique volume those between the box's extents along its axes.
// Throws Error kInvalidParameter, field "crop", if there are fewer than two along an axis, and so
// no surface.
SampleRange samples_in(const Box& box, const Geometry& geometry,
                       const std::array<std::uint32_t, 3>& dims);

// A volume, or a copy of the part that the parameters crop it to, as a volume of its own. `samples`
// must outlive it. Throws as samples_in.
class CroppedSamples {
 public:
  CroppedSamples(const SampleArray& samples, const MeshParameters& parameters);

  const SampleArray& array() const { return array_; }

 private:
  SampleArray array_;
  mesh::Buffer<std::byte> copy_;
};

}  // namespace isomesh::jobs
