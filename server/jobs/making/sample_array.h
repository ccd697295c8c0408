// A volume in memory, as the stages of a job see it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "proto/types.h"
#include "server/mesh/lattice/lattice.h"
#include "server/mesh/lattice/placement.h"

namespace isomesh::jobs {

// Type, dims and geometry are as in Volume. The caller owns the bytes.
struct SampleArray {
  SampleType type = SampleType::kUint8;
  std::array<std::uint32_t, 3> dims = {0, 0, 0};
  Geometry geometry;
  const std::byte* bytes = nullptr;
};

// T must be the type of the samples.
template <class T>
mesh::Lattice<T> lattice_of(const SampleArray& samples) {
  return {reinterpret_cast<const T*>(samples.bytes),
          {samples.dims[0], samples.dims[1], samples.dims[2]},
          mesh::lattice_to_space(samples.geometry)};
}

}  // namespace isomesh::jobs
