#include "server/mesh/collapse/gradient_normals.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/collapse/bound.h"
#include "server/mesh/measure/normals.h"
#include "server/mesh/points.h"
#include "tests/support/kernels.h"
#include "tests/support/shapes.h"

namespace isomesh::mesh {
namespace {

double cosine(const Vec3& normal, const Point& way) {
  return (normal[0] * way[0] + normal[1] * way[1] + normal[2] * way[2]) / std::sqrt(dot(way, way));
}

// The least cosine between the mesh's normals and what `outward` says.
template <class Outward>
double worst(const Mesh& mesh, const Buffer<Vec3>& normals, Outward outward) {
  double least = 1;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const Vec3& p = mesh.positions[v];
    least = std::min(least, cosine(normals[v], outward(Point{p[0], p[1], p[2]})));
  }
  return least;
}

// A ball in millimetres, whatever the lattice is; of a fifth of the triangles.
TEST(GradientNormals, OfABallPointFromItsCentre) {
  for (const auto& [name, geometry] : test::all_geometries()) {
    SCOPED_TRACE(name);
    const LatticeToSpace map = lattice_to_space(geometry);
    Point centre = map.origin;
    for (std::size_t n = 0; n < 3; ++n) {
      centre[n] += 10 * (map.step_x[n] + map.step_y[n] + map.step_z[n]);
    }
    const double step = *std::ranges::min_element(geometry.spacing);
    const double radius = 7 * step;
    const auto outward = [&](const Point& p) { return minus(p, centre); };
    const auto volume = test::sample<float>(
        [&](const test::Point& p) {
          const Point way = outward({p[0], p[1], p[2]});
          return radius - std::sqrt(dot(way, way));
        },
        {21, 21, 21}, geometry);
    Mesh mesh = test::extracted(volume, {});
    ASSERT_TRUE(simplify_within(volume.lattice(), {}, {.max_error_mm = 0.1 * step}, {}, mesh));
    Buffer<Vec3> normals;
    vertex_normals(mesh, {}, normals);
    const double of_triangles = worst(mesh, normals, outward);
    set_gradient_normals(volume.lattice(), Inside::kAbove, {}, mesh);
    vertex_normals(mesh, {}, normals);
    EXPECT_GT(worst(mesh, normals, outward), std::cos(6 * std::numbers::pi / 180));
    EXPECT_GT(worst(mesh, normals, outward), of_triangles);
  }
}

TEST(GradientNormals, LeaveCapsFlat) {
  const auto volume = test::sample<float>(test::sphere({10, 10, 0}, 7.3), {21, 21, 14});
  Mesh mesh = test::extracted(volume, {.close = true});
  Buffer<Vec3> of_triangles;
  vertex_normals(mesh, {}, of_triangles);
  set_gradient_normals(volume.lattice(), Inside::kAbove, {}, mesh);
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    if (!mesh.is_on_border(v)) continue;
    EXPECT_EQ(mesh.normals[v], of_triangles[v]);
  }
}

// A sheet of one sample: the gradient vanishes in the middle.
TEST(GradientNormals, AreThoseOfTrianglesWhereSamplesHaveNoDirection) {
  auto volume = test::constant<std::uint8_t>(0, {9, 9, 9});
  volume.at(4, 4, 4) = 100;
  Mesh mesh = test::extracted(volume, {.iso = 99.999});
  Buffer<Vec3> of_triangles;
  vertex_normals(mesh, {}, of_triangles);
  set_gradient_normals(volume.lattice(), Inside::kAbove, {}, mesh);
  ASSERT_EQ(mesh.normals.size(), mesh.positions.size());
  for (std::size_t v = 0; v < mesh.normals.size(); ++v) {
    const Vec3& n = mesh.normals[v];
    EXPECT_NEAR(n[0] * n[0] + n[1] * n[1] + n[2] * n[2], 1, 1e-5);
    EXPECT_GT(cosine(n, {of_triangles[v][0], of_triangles[v][1], of_triangles[v][2]}), 0.24);
  }
}

Buffer<Vec3> normals_of_a_ball(double scale) {
  const auto volume =
      test::sample<double>(test::scaled(test::sphere({10, 10, 10}, 7.3), scale, 0), {21, 21, 21});
  Mesh mesh = test::extracted(volume, {});
  set_gradient_normals(volume.lattice(), Inside::kAbove, {}, mesh);
  Buffer<Vec3> normals;
  vertex_normals(mesh, {}, normals);
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const Point outward = minus(to_point(mesh.positions[v]), Point{10, 10, 10});
    EXPECT_GT(cosine(normals[v], outward), std::cos(8 * std::numbers::pi / 180));
  }
  return normals;
}

TEST(GradientNormals, AreTheSameForSamplesTimesAPowerOfTwo) {
  const Buffer<Vec3> normals = normals_of_a_ball(1);
  for (const double scale : {0x1p-1000, 0x1p-560, 0x1p-500, 0x1p500, 0x1p1019}) {
    EXPECT_TRUE(std::ranges::equal(normals, normals_of_a_ball(scale))) << scale;
  }
}

TEST(GradientNormals, OfSamplesThatAreHardlyNumbersPointFromTheCentre) {
  for (const double scale : {1e-322, 1e-170, 1e-162, 1e300}) {
    SCOPED_TRACE(scale);
    normals_of_a_ball(scale);
  }
}

}  // namespace
}  // namespace isomesh::mesh
