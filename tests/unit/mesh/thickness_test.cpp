#include "server/mesh/measure/thickness.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <initializer_list>
#include <limits>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/measure/point_triangle.h"
#include "tests/support/any_threads.h"
#include "tests/support/errors.h"
#include "tests/support/kernels.h"

namespace isomesh::mesh {
namespace {

struct Body {
  std::vector<Vec3> positions;
  std::vector<Triangle> triangles;

  SurfaceView view() const { return {positions, triangles}; }

  void add(const Body& other) {
    const auto first = static_cast<std::uint32_t>(positions.size());
    positions.insert(positions.end(), other.positions.begin(), other.positions.end());
    for (const auto& [a, b, c] : other.triangles) {
      triangles.push_back({first + a, first + b, first + c});
    }
  }
};

Body box_between(const Vec3& low, const Vec3& high) {
  Body box;
  for (unsigned corner = 0; corner < 8; ++corner) {
    box.positions.push_back({(corner & 1) != 0 ? high[0] : low[0],
                             (corner & 2) != 0 ? high[1] : low[1],
                             (corner & 4) != 0 ? high[2] : low[2]});
  }
  const std::array<std::array<std::uint32_t, 4>, 6> sides = {
      {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}}};
  for (const auto& [a, b, c, d] : sides) {
    box.triangles.push_back({a, b, c});
    box.triangles.push_back({a, c, d});
  }
  return box;
}

// A closed tube or ball: rings of points around the z axis, from the lowest on, and a pole each.
Body turned(const std::vector<std::array<double, 2>>& radius_and_z, double low_z, double high_z) {
  constexpr std::uint32_t kAround = 48;
  Body body;
  for (const auto& [radius, z] : radius_and_z) {
    for (std::uint32_t n = 0; n < kAround; ++n) {
      const double angle = 2 * std::numbers::pi * n / kAround;
      body.positions.push_back({static_cast<float>(radius * std::cos(angle)),
                                static_cast<float>(radius * std::sin(angle)),
                                static_cast<float>(z)});
    }
  }
  const auto low = static_cast<std::uint32_t>(body.positions.size());
  body.positions.push_back({0, 0, static_cast<float>(low_z)});
  body.positions.push_back({0, 0, static_cast<float>(high_z)});
  const auto last = static_cast<std::uint32_t>(radius_and_z.size() - 1) * kAround;
  for (std::uint32_t n = 0; n < kAround; ++n) {
    const std::uint32_t next = (n + 1) % kAround;
    body.triangles.push_back({low, next, n});
    for (std::uint32_t ring = 0; ring < last; ring += kAround) {
      body.triangles.push_back({ring + n, ring + next, ring + kAround + next});
      body.triangles.push_back({ring + n, ring + kAround + next, ring + kAround + n});
    }
    body.triangles.push_back({last + n, last + next, low + 1});
  }
  return body;
}

Body ball(double radius) {
  constexpr int kRings = 24;
  std::vector<std::array<double, 2>> rings;
  for (int n = 1; n < kRings; ++n) {
    const double angle = std::numbers::pi * n / kRings;
    rings.push_back({radius * std::sin(angle), -radius * std::cos(angle)});
  }
  return turned(rings, -radius, radius);
}

Body needle(double radius, double length) {
  std::vector<std::array<double, 2>> rings;
  for (double z = 0; z < length; z += radius) rings.push_back({radius, z});
  rings.push_back({radius, length});
  return turned(rings, 0, length);
}

Body inside_out(Body body) {
  for (Triangle& triangle : body.triangles) std::swap(triangle[1], triangle[2]);
  return body;
}

Thickness thickness_of(const Body& body, double below_mm) {
  double area = 0;
  for (std::size_t t = 0; t < body.triangles.size(); ++t) {
    const auto [a, b, c] = corners_of(body.view(), t);
    const Point normal = normal_of(a, b, c);
    area += std::sqrt(dot(normal, normal)) / 2;
  }
  return measure_thickness(body.view(), below_mm, area, {});
}

double thinnest_of(const Body& body, double below_mm = 0.4) {
  return thickness_of(body, below_mm)
      .thinnest_mm.value_or(std::numeric_limits<double>::quiet_NaN());
}

TEST(Thickness, IsThatOfASlab) {
  for (const float thick : {0.3F, 0.5F, 7.0F}) {
    const Thickness found = thickness_of(box_between({0, 0, 0}, {20, 10, thick}), 0.4);
    ASSERT_TRUE(found.thinnest_mm && found.place);
    EXPECT_NEAR(*found.thinnest_mm, thick, 1e-5);
    const double z = (*found.place)[2];
    EXPECT_TRUE(std::abs(z) < 1e-5 || std::abs(z - thick) < 1e-5) << z;
    // Both of its large sides; the narrow ones have walls of 10 and 20 mm behind them.
    EXPECT_NEAR(found.thin_area_mm2, thick < 0.4F ? 400 : 0, 1e-6);
  }
}

TEST(Thickness, DoesNotVanishAtTheEdgesOfACube) {
  const Thickness found = thickness_of(box_between({-5, -5, -5}, {5, 5, 5}), 0.4);
  EXPECT_NEAR(found.thinnest_mm.value_or(0), 10, 1e-6);
  EXPECT_EQ(found.thin_area_mm2, 0);
}

TEST(Thickness, OfABallIsItsDiameterAndOfANeedleItsOwn) {
  EXPECT_NEAR(thinnest_of(ball(5)), 10, 0.1);
  const Body thin = needle(0.1, 10);
  EXPECT_NEAR(thinnest_of(thin), 0.2, 0.002);
  // All around, but for its ends.
  EXPECT_NEAR(thickness_of(thin, 0.4).thin_area_mm2, 2 * std::numbers::pi * 0.1 * 10, 0.03);
}

TEST(Thickness, IsThatOfTheWallOfAHollowBall) {
  Body shell = ball(5);
  shell.add(inside_out(ball(4.7)));
  EXPECT_NEAR(thinnest_of(shell), 0.3, 0.01);
  EXPECT_NEAR(thickness_of(shell, 0.4).thin_area_mm2, 4 * std::numbers::pi * (25 + 4.7 * 4.7),
              0.02 * 600);
}

// A prism 20 mm long whose sides meet at an angle along y, 20 mm from its back.
Body blade(double angle) {
  const auto half = static_cast<float>(20 * std::tan(angle / 2));
  return {{{0, 0, 0}, {20, 0, -half}, {20, 0, half}, {0, 20, 0}, {20, 20, -half}, {20, 20, half}},
          {{0, 1, 2}, {3, 5, 4}, {0, 4, 1}, {0, 3, 4}, {0, 2, 5}, {0, 5, 3}, {1, 4, 5}, {1, 5, 2}}};
}

// Both sides are thin where they are nearer than 0.4 mm, but for what is 0.4 mm from the edge.
TEST(Thickness, OfABladeBeginsBesideItsEdge) {
  const double angle = 15 * std::numbers::pi / 180;
  const double end = 0.4 / std::tan(angle);
  EXPECT_NEAR(thickness_of(blade(angle), 0.4).thin_area_mm2, 2 * 20 * (end - 0.4), 2);
  EXPECT_NEAR(thinnest_of(blade(angle)), 0.4 * std::tan(angle), 0.03);
  // Hardly anything is thin beside an edge of 50 degrees: what has a corner alone in common.
  EXPECT_LT(thickness_of(blade(50 * std::numbers::pi / 180), 0.4).thin_area_mm2, 0.1);
}

TEST(Thickness, IsThroughMaterialAlone) {
  // Two plates 0.1 mm apart, and a slit of 0.1 mm.
  Body plates = box_between({0, 0, 0}, {20, 20, 2});
  plates.add(box_between({0, 0, 2.1F}, {20, 20, 4.1F}));
  EXPECT_NEAR(thinnest_of(plates), 2, 1e-5);
  EXPECT_EQ(thickness_of(plates, 0.4).thin_area_mm2, 0);
  Body slit = box_between({0, 0, 0}, {20, 20, 20});
  slit.add(inside_out(box_between({5, 5, 10}, {15, 15, 10.1F})));
  EXPECT_NEAR(thinnest_of(slit), 5, 1e-5);
  // A plate beside the edge of a block: no part of the block is thin.
  Body beside = box_between({0, 0, 0}, {10, 10, 10});
  beside.add(box_between({10.05F, 0, 9.8F}, {20, 10, 10}));
  EXPECT_NEAR(thickness_of(beside, 0.4).thin_area_mm2, 2 * 9.95 * 10, 1e-3);
}

TEST(Thickness, OfLargeTrianglesIsMeasuredInTheirMiddleToo) {
  // A pit under one side of a plate, far from the centres of that side's triangles.
  Body plate = box_between({0, 0, 0}, {40, 40, 3});
  plate.add(inside_out(box_between({30, 7, 0.5F}, {31, 8, 2.8F})));
  const Thickness found = thickness_of(plate, 0.4);
  EXPECT_NEAR(found.thinnest_mm.value_or(0), 0.2, 1e-5);
  EXPECT_NEAR(found.thin_area_mm2, 2, 0.3);
}

TEST(Thickness, NeedsAnOppositeSide) {
  const std::vector<Vec3> corners = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const Body open = {corners, {{0, 2, 1}, {0, 1, 3}}};
  for (const Body& body : {Body(), open, inside_out(box_between({0, 0, 0}, {9, 9, 0.1F}))}) {
    const Thickness found = thickness_of(body, 0.4);
    EXPECT_FALSE(found.thinnest_mm || found.place);
    EXPECT_EQ(found.thin_area_mm2, 0);
  }
}

TEST(Thickness, IsTheSameOnAnyThreads) {
  Body bodies = needle(0.1, 10);
  bodies.add(ball(5));
  const auto found = test::expect_same_on_any_threads([&] { return thickness_of(bodies, 0.4); });
  EXPECT_GT(found.thin_area_mm2, 1);
}

// A large body leaves fewer points to others, so a cavity below a large side is seen from its own
// side alone.
TEST(Thickness, HasFewerPointsOfTrianglesBesideMuchLargerSurfaces) {
  Body body = box_between({0, 0, 0}, {10, 10, 10});
  body.add(inside_out(box_between({1, 1, 8.8}, {2, 2, 9.8})));
  EXPECT_NEAR(thickness_of(body, 0.4).thin_area_mm2, 2, 0.3);
  constexpr double kMuchLarger = 1e12;
  EXPECT_NEAR(measure_thickness(body.view(), 0.4, kMuchLarger, {}).thin_area_mm2, 1, 1e-3);
}

TEST(Thickness, StopsAndRefusesWhatIsNotFinite) {
  std::stop_source stop;
  stop.request_stop();
  const Body body = box_between({0, 0, 0}, {1, 1, 1});
  EXPECT_EQ(test::code_thrown_by([&] {
              measure_thickness(body.view(), 0.4, 6, {stop.get_token(), nullptr});
            }),
            ErrorCode::kCancelled);
  Body broken = body;
  broken.positions[3][1] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(test::code_thrown_by([&] { thickness_of(broken, 0.4); }), ErrorCode::kUnusableVolume);
}

}  // namespace
}  // namespace isomesh::mesh
