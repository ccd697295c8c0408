// The volumes that are measured, held in memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "proto/samples.h"
#include "proto/types.h"
#include "server/mesh/lattice/lattice.h"

namespace isomesh::bench {

// Samples with their owner, x fastest, as many bytes as dims and type tell.
struct Samples {
  std::string name;    // as it appears in the names of benchmarks
  std::string source;  // its file, or its size if it is synthetic; empty if it is derived
  SampleType type = SampleType::kUint8;
  mesh::Dims dims;
  Geometry geometry;
  std::vector<std::byte> bytes;

  template <class T>
  const T* as() const {
    return reinterpret_cast<const T*>(bytes.data());
  }
};

// Calls visit(const T* samples) with T the type of the samples.
template <class Visit>
decltype(auto) visit_samples(const Samples& samples, Visit visit) {
  return with_sample(samples.type,
                     [&](auto sample) { return visit(samples.as<decltype(sample)>()); });
}

struct LoadedVolume {
  Samples samples;
  double suggested_iso = 0;
};

// Reads a file in any format that the daemon imports, through the daemon's own import. Throws Error
// with the reason when it cannot.
LoadedVolume load_volume(const std::filesystem::path& path);

// A field of n^3 uint8 samples whose surface at kFieldIso grows with n^2: a gyroid of a fixed
// number of periods per volume with a finer and weaker one on it. Deterministic.
inline constexpr double kFieldIso = 127.5;
Samples synthetic_field(std::uint32_t n);

}  // namespace isomesh::bench
