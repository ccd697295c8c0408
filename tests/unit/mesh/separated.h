// Label fields, and short ways to separate their labels.
#pragma once

#include <cstdint>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/labels/label_surface.h"
#include "server/mesh/labels/label_voxels.h"
#include "server/mesh/labels/separate.h"
#include "tests/support/kernels.h"
#include "tests/support/label_reference.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"

namespace isomesh::mesh {

// Sample types that label volumes can have.
using LabelTypes = testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                                  std::uint32_t, std::int32_t>;

template <class T>
void separate_into(SeparatingSurface& surface, const test::SampleVolume<T>& volume,
                   const SeparateOptions& options) {
  const Lattice<T> lattice = volume.lattice();
  const SurfaceCount count = count_walls(lattice, options, {});
  extract_walls(lattice, options, count, {}, surface);
}

template <class T>
SeparatingSurface separated(const test::SampleVolume<T>& volume, const SeparateOptions& options) {
  SeparatingSurface surface;
  separate_into(surface, volume, options);
  return surface;
}

// first, first + 1, ...
template <class T = std::int64_t>
std::vector<T> consecutive(T first, std::size_t count) {
  std::vector<T> labels;
  for (std::size_t n = 0; n < count; ++n) labels.push_back(static_cast<T>(first + n));
  return labels;
}

// The two schemes, open and closed.
inline std::vector<SeparateOptions> all_separations(const std::vector<std::int64_t>& labels) {
  std::vector<SeparateOptions> all;
  for (const Scheme scheme : {Scheme::kFive, Scheme::kSix}) {
    for (const bool close : {false, true}) all.push_back({labels, scheme, close});
  }
  return all;
}

inline std::string describe(const Dims& dims, const SeparateOptions& options) {
  std::ostringstream text;
  text << dims.x << "x" << dims.y << "x" << dims.z << ", " << options.labels.size()
       << " labels, scheme " << static_cast<int>(options.scheme)
       << (options.close ? ", closed" : ", open");
  return text.str();
}

// The samples 0 to count - 1, all equally likely: of every four neighbours most differ.
inline test::SampleVolume<std::uint8_t> label_noise(std::size_t count, const Dims& dims,
                                                    std::uint64_t seed,
                                                    const Geometry& geometry = {}) {
  return test::noise<std::uint8_t>(consecutive<std::uint8_t>(0, count), dims, seed, geometry);
}

// Compact labels that touch each other, 1 on: each sample has that of the nearest of some points,
// or 0 where all are far.
inline test::SampleVolume<std::uint8_t> label_cells(std::size_t count, const Dims& dims,
                                                    double reach, std::uint64_t seed) {
  const auto places =
      test::noise_between<float>(0, 1, {3, static_cast<std::uint32_t>(count), 1}, seed);
  auto volume = test::constant<std::uint8_t>(0, dims);
  for (std::uint32_t k = 0; k < dims.z; ++k) {
    for (std::uint32_t j = 0; j < dims.y; ++j) {
      for (std::uint32_t i = 0; i < dims.x; ++i) {
        double nearest = reach * reach;
        for (std::size_t n = 0; n < count; ++n) {
          const double x = i - places.samples[3 * n] * dims.x;
          const double y = j - places.samples[3 * n + 1] * dims.y;
          const double z = k - places.samples[3 * n + 2] * dims.z;
          const double square = x * x + y * y + z * z;
          if (square >= nearest) continue;
          nearest = square;
          volume.at(i, j, k) = static_cast<std::uint8_t>(n + 1);
        }
      }
    }
  }
  return volume;
}

inline Mesh label_mesh(const SeparatingSurface& surface, std::size_t number) {
  return std::move(label_surfaces(surface, {})[number - 1].mesh);
}

inline std::vector<LabelMeasure> label_measures(const SeparatingSurface& surface) {
  return measure_labels(surface, label_surfaces(surface, {}), {});
}

template <class T>
std::vector<std::uint64_t> counted_triangles(const Lattice<T>& lattice,
                                             const SeparateOptions& options) {
  return count_label_triangles(lattice, options, count_walls(lattice, options, {}), {});
}

inline testing::AssertionResult same_bytes(const SeparatingSurface& a, const SeparatingSurface& b) {
  if (const auto result = test::same_bytes(a.mesh, b.mesh); !result) return result;
  if (a.mesh.on_line != b.mesh.on_line) return testing::AssertionFailure() << "the lines differ";
  if (!std::ranges::equal(a.sides, b.sides)) {
    return testing::AssertionFailure() << "the sides differ";
  }
  return testing::AssertionSuccess();
}

}  // namespace isomesh::mesh
