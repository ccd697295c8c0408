// Short forms for running the kernels.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "proto/types.h"
#include "server/mesh/extract/extract.h"
#include "server/mesh/extract/windows.h"
#include "server/mesh/mesh.h"
#include "server/mesh/parallel.h"
#include "server/mesh/smooth/smooth.h"
#include "tests/support/shapes.h"

namespace isomesh::test {

inline constexpr std::array kSchemes = {Scheme::kSix, Scheme::kFive, Scheme::kBcc};

// Counts and extracts into `mesh`, reusing its memory.
template <class T>
void extract_into(mesh::Mesh& mesh, const SampleVolume<T>& volume,
                  const mesh::ExtractOptions& options, const mesh::Context& context = {}) {
  const mesh::Lattice<T> lattice = volume.lattice();
  mesh::SurfaceWindows(lattice, options, context).write_whole(context, mesh);
}

template <class T>
mesh::Mesh extracted(const SampleVolume<T>& volume, const mesh::ExtractOptions& options) {
  mesh::Mesh mesh;
  extract_into(mesh, volume, options);
  return mesh;
}

// The size of a surface of equal layers.
inline mesh::SurfaceSize even_surface(std::uint64_t layers, std::uint64_t vertices_each,
                                      std::uint64_t triangles_each) {
  mesh::SurfaceCount count;
  for (std::uint64_t k = 1; k <= layers; ++k) {
    count.layer_vertices.push_back(k * vertices_each);
    count.layer_triangles.push_back(k * triangles_each);
  }
  return size_of(count);
}

// Passes of steps to the mean of the neighbours, or away from it, by these weights.
inline std::vector<mesh::Step> means(int passes, const std::vector<double>& weights) {
  std::vector<mesh::Step> steps;
  for (int pass = 0; pass < passes; ++pass) {
    for (const double weight : weights) steps.push_back({mesh::Move::kMean, weight});
  }
  return steps;
}

// The steps of that many passes of a method by its default weights.
inline mesh::SmoothOptions method_options(Smoothing smoothing, int passes) {
  const mesh::SmoothingMethod& method = mesh::method_of(smoothing);
  const mesh::Relaxation relaxation = {row_of(smoothing).lambda.value_or(1),
                                       MeshParameters{}.pass_band};
  return {.steps = method.steps(passes, relaxation), .at_curves = method.at_curves};
}

// A mesh of one layer.
inline mesh::Mesh mesh_of(const std::vector<mesh::Vec3>& positions,
                          const std::vector<mesh::Triangle>& triangles) {
  mesh::Mesh mesh;
  mesh.positions.resize_for_overwrite(positions.size());
  std::ranges::copy(positions, mesh.positions.begin());
  mesh.triangles.resize_for_overwrite(triangles.size());
  std::ranges::copy(triangles, mesh.triangles.begin());
  mesh.layer_vertices = {0, positions.size()};
  mesh.layer_triangles = {0, triangles.size()};
  return mesh;
}

inline mesh::Mesh copy_of(const mesh::Mesh& other) {
  mesh::Mesh copy;
  copy.origin = other.origin;
  copy.positions.resize_for_overwrite(other.positions.size());
  std::ranges::copy(other.positions, copy.positions.begin());
  copy.triangles.resize_for_overwrite(other.triangles.size());
  std::ranges::copy(other.triangles, copy.triangles.begin());
  copy.layer_vertices = other.layer_vertices;
  copy.layer_triangles = other.layer_triangles;
  copy.on_border = other.on_border;
  copy.kept = other.kept;
  copy.on_line = other.on_line;
  copy.normals = other.normals;
  return copy;
}

// Changes the kernels' number of threads during its lifetime. Not for tests that run kernels
// concurrently.
class ThreadCount {
 public:
  explicit ThreadCount(int threads) : before_(mesh::thread_count()) {
    mesh::set_thread_count(threads);
  }
  ~ThreadCount() { mesh::set_thread_count(before_); }
  ThreadCount(const ThreadCount&) = delete;
  ThreadCount& operator=(const ThreadCount&) = delete;

 private:
  int before_;
};

}  // namespace isomesh::test
