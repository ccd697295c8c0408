#include "server/mesh/measure/normals.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/support/any_threads.h"
#include "tests/support/errors.h"
#include "tests/support/kernels.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"

namespace isomesh::mesh {
namespace {

Mesh sphere(const Geometry& geometry = {}) {
  test::SampleVolume<float> volume =
      test::sample<float>(test::sphere({10, 10, 10}, 8), {21, 21, 21});
  volume.geometry = geometry;
  return test::extracted(volume, {0, Scheme::kSix, Interpolation::kMidpoint});
}

Buffer<Vec3> normals_of(const Mesh& mesh) {
  Buffer<Vec3> normals;
  vertex_normals(mesh, {}, normals);
  return normals;
}

// Summed the plain way over all triangles in their order.
TEST(Normals, AreTheMeanOfTheTrianglesWeightedByArea) {
  const Mesh mesh = sphere(test::oblique_left_handed_geometry());
  std::vector<test::Point> sums(mesh.positions.size(), test::Point{0, 0, 0});
  const test::Surface surface = test::surface_of(mesh);
  for (const auto& [a, b, c] : surface.triangles) {
    const test::Point& p = surface.points[a];
    test::Point u;
    test::Point v;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      u[axis] = surface.points[b][axis] - p[axis];
      v[axis] = surface.points[c][axis] - p[axis];
    }
    for (const std::uint32_t vertex : {a, b, c}) {
      sums[vertex][0] += u[1] * v[2] - u[2] * v[1];
      sums[vertex][1] += u[2] * v[0] - u[0] * v[2];
      sums[vertex][2] += u[0] * v[1] - u[1] * v[0];
    }
  }
  const Buffer<Vec3> normals = normals_of(mesh);
  ASSERT_EQ(normals.size(), sums.size());
  for (std::size_t n = 0; n < sums.size(); ++n) {
    const double length = std::hypot(sums[n][0], sums[n][1], sums[n][2]);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      ASSERT_NEAR(normals[n][axis], sums[n][axis] / length, 1e-4);
    }
  }
}

TEST(Normals, PointOut) {
  const Mesh mesh = sphere();
  const Buffer<Vec3> normals = normals_of(mesh);
  for (std::size_t v = 0; v < normals.size(); ++v) {
    double cosine = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      cosine += normals[v][axis] * (mesh.positions[v][axis] - 10.0);
    }
    ASSERT_GT(cosine, 0);
  }
}

TEST(Normals, AreTheSameOnAnyNumberOfThreads) {
  const Mesh mesh = sphere();
  test::expect_same_on_any_threads([&] { return normals_of(mesh); }, std::ranges::equal);
}

TEST(Normals, WithoutADirectionPointUp) {
  Mesh mesh;
  mesh.positions.resize_for_overwrite(3);
  for (std::size_t v = 0; v < 3; ++v) mesh.positions[v] = {static_cast<float>(v), 0, 0};
  mesh.triangles.resize_for_overwrite(1);
  mesh.triangles[0] = {0, 1, 2};
  mesh.layer_vertices = {0, 3};
  mesh.layer_triangles = {0, 1};
  for (const Vec3& normal : normals_of(mesh)) EXPECT_EQ(normal, (Vec3{0, 0, 1}));
}

TEST(Normals, StopWhenTheyAreCancelled) {
  std::stop_source stop;
  stop.request_stop();
  Buffer<Vec3> normals;
  EXPECT_EQ(test::code_thrown_by([&] {
              vertex_normals(sphere(), {stop.get_token(), {}}, normals);
            }),
            ErrorCode::kCancelled);
}

}  // namespace
}  // namespace isomesh::mesh
