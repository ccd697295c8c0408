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

// A volume, or a copy of the part that the parameters crop it to, as a volume of its own. For
// labels it is a copy of integers if the samples are floats. `samples` must outlive it. Throws as
// samples_in and volume::round_labels.
class CroppedSamples {
 public:
  CroppedSamples(const SampleArray& samples, const MeshParameters& parameters);

  const SampleArray& array() const { return array_; }

  // True if a sample was no whole number.
  bool is_rounded() const { return is_rounded_; }

  // The memory of the copies that it holds, and that of those which it takes meanwhile, for samples
  // of that type. The latter throws as samples_in.
  std::uint64_t bytes() const { return copy_.size() + rounded_.size() * sizeof(std::int32_t); }
  static std::uint64_t most_bytes(const MeshParameters& parameters, const Geometry& geometry,
                                  const std::array<std::uint32_t, 3>& dims, SampleType type);

 private:
  void crop(const SampleArray& samples, const SampleRange& range);
  void round();

  SampleArray array_;
  mesh::Buffer<std::byte> copy_;
  mesh::Buffer<std::int32_t> rounded_;
  bool is_rounded_ = false;
};

}  // namespace isomesh::jobs
