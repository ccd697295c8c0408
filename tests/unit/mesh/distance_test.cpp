#include "server/mesh/measure/distance.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/any_threads.h"
#include "tests/support/errors.h"
#include "tests/support/kernels.h"
#include "tests/support/points.h"
#include "tests/support/shapes.h"

namespace isomesh::mesh {
namespace {

using test::mesh_of;

constexpr float kInfinite = std::numeric_limits<float>::infinity();

Mesh ball(double radius, std::uint32_t n = 24) {
  return test::extracted(test::sample<float>(test::sphere({0, 0, 0}, radius),
                                             test::unit_cube_dims(n), test::unit_cube_geometry(n)),
                         {0, Scheme::kSix, Interpolation::kLinear, false});
}

// A square of n x n squares of side 1, each of two triangles.
Mesh sheet(std::uint32_t n, float z = 0) {
  std::vector<Vec3> positions;
  std::vector<Triangle> triangles;
  for (std::uint32_t y = 0; y <= n; ++y) {
    for (std::uint32_t x = 0; x <= n; ++x) {
      positions.push_back({static_cast<float>(x), static_cast<float>(y), z});
      if (x == n || y == n) continue;
      const std::uint32_t at = y * (n + 1) + x;
      triangles.push_back({at, at + 1, at + n + 2});
      triangles.push_back({at, at + n + 2, at + n + 1});
    }
  }
  return mesh_of(positions, triangles);
}

Mesh random_triangles(std::size_t count, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> place(-5, 5);
  std::uniform_real_distribution<float> size(-0.8F, 0.8F);
  std::vector<Vec3> positions;
  std::vector<Triangle> triangles;
  for (std::uint32_t t = 0; t < count; ++t) {
    const Vec3 at = {place(random), place(random), place(random)};
    for (int corner = 0; corner < 3; ++corner) {
      positions.push_back({at[0] + size(random), at[1] + size(random), at[2] + size(random)});
    }
    triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
  }
  return mesh_of(positions, triangles);
}

// To the nearest of many points spread over the triangle and its edges: never less than it is.
double sampled_distance(const Point& point, const Corners& t) {
  constexpr int kSteps = 400;
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; i + j <= kSteps; ++j) {
      const double v = static_cast<double>(i) / kSteps;
      const double w = static_cast<double>(j) / kSteps;
      const test::Point q = {t[0][0] + v * (t[1][0] - t[0][0]) + w * (t[2][0] - t[0][0]),
                             t[0][1] + v * (t[1][1] - t[0][1]) + w * (t[2][1] - t[0][1]),
                             t[0][2] + v * (t[1][2] - t[0][2]) + w * (t[2][2] - t[0][2])};
      least = std::min(least, test::length(test::minus(q, point)));
    }
  }
  return least;
}

Corners corners_of(const Mesh& mesh, const Triangle& triangle) {
  return {to_point(mesh.positions[triangle[0]]), to_point(mesh.positions[triangle[1]]),
          to_point(mesh.positions[triangle[2]])};
}

// Over all triangles, one by one.
double plain_distance(const Point& point, const Mesh& mesh) {
  double squared = std::numeric_limits<double>::infinity();
  for (const Triangle& triangle : mesh.triangles) {
    squared = std::min(squared, squared_distance(point, corners_of(mesh, triangle)));
  }
  return std::sqrt(squared);
}

std::vector<double> plain_distances(const Mesh& from, const Mesh& to) {
  std::vector<double> distances;
  for (const Vec3& position : from.positions) {
    distances.push_back(plain_distance(to_point(position), to));
  }
  for (const Triangle& triangle : from.triangles) {
    const Corners t = corners_of(from, triangle);
    distances.push_back(
        plain_distance({(t[0][0] + t[1][0] + t[2][0]) / 3, (t[0][1] + t[1][1] + t[2][1]) / 3,
                        (t[0][2] + t[1][2] + t[2][2]) / 3},
                       to));
  }
  return distances;
}

void expect_as_plain(const Mesh& from, const Mesh& to) {
  std::vector<double> plain = plain_distances(from, to);
  const DistanceSummary summary = measure_distance(from, TriangleGrid(to, {}), {});
  ASSERT_EQ(summary.points, plain.size());
  const auto count = static_cast<double>(plain.size());
  const double rounding = 1e-6 * std::max(1.0, std::ranges::max(plain));
  EXPECT_NEAR(summary.mean_mm, std::reduce(plain.begin(), plain.end()) / count, rounding);
  EXPECT_NEAR(summary.rms_mm,
              std::sqrt(std::inner_product(plain.begin(), plain.end(), plain.begin(), 0.0) / count),
              rounding);
  std::ranges::sort(plain);
  EXPECT_NEAR(summary.max_mm, plain.back(), rounding);
  const auto rank = static_cast<std::size_t>(std::ceil(0.99 * count)) - 1;
  EXPECT_NEAR(summary.p99_mm, plain[rank], rounding);
  EXPECT_EQ(std::reduce(summary.histogram.begin(), summary.histogram.end()), plain.size());
}

TEST(Distance, OfAPointAndATriangleIsToItsNearestPoint) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(-2, 2);
  const auto point = [&] { return Point{place(random), place(random), place(random)}; };
  for (int i = 0; i < 120; ++i) {
    const Corners triangle = {point(), point(), point()};
    const Point from = point();
    const double found = std::sqrt(squared_distance(from, triangle));
    const double sampled = sampled_distance(from, triangle);
    EXPECT_LE(found, sampled + 1e-12);
    EXPECT_NEAR(found, sampled, 0.03);
  }
}

TEST(Distance, OfATriangleThatIsALineOrAPointIsToThat) {
  const Corners point = {Point{1, 2, 3}, {1, 2, 3}, {1, 2, 3}};
  EXPECT_DOUBLE_EQ(squared_distance({1, 2, 7}, point), 16);
  const Corners line = {Point{0, 0, 0}, {4, 0, 0}, {1, 0, 0}};
  EXPECT_DOUBLE_EQ(squared_distance({2, 3, 0}, line), 9);
  EXPECT_DOUBLE_EQ(squared_distance({6, 0, 0}, line), 4);
  const Corners twice = {Point{0, 0, 0}, {0, 0, 0}, {4, 0, 0}};
  EXPECT_DOUBLE_EQ(squared_distance({3, 2, 0}, twice), 4);
  // As good as a line: the third corner is off by less than rounding leaves of a normal.
  const Corners needle = {Point{0, 0, 0}, {4, 0, 0}, {2, 1e-14, 0}};
  EXPECT_NEAR(squared_distance({1, 0, 5}, needle), 25, 1e-9);
}

TEST(Distance, IsThatOfAPlainSearch) {
  for (const std::uint32_t seed : {1, 2, 3}) {
    expect_as_plain(random_triangles(300, seed), random_triangles(200, seed + 10));
  }
  expect_as_plain(ball(0.7, 12), random_triangles(50, 5));
  expect_as_plain(random_triangles(50, 5), ball(0.7, 12));
  expect_as_plain(sheet(9), sheet(7, 0.25));
}

// Large triangles reach through many cells that small ones make.
TEST(Distance, IsThatOfAPlainSearchWhereTrianglesDifferInSize) {
  Mesh small = sheet(20);
  std::vector<Vec3> positions(small.positions.begin(), small.positions.end());
  std::vector<Triangle> triangles(small.triangles.begin(), small.triangles.end());
  const auto first = static_cast<std::uint32_t>(positions.size());
  positions.insert(positions.end(), {{-300, 10, 40}, {200, -150, 90}, {50, 250, -120}});
  triangles.push_back({first, first + 1, first + 2});
  positions.insert(positions.end(), {{-300, -300, -300}, {300, 300, 300}, {0, 0, 0}});
  triangles.push_back({first + 3, first + 4, first + 5});
  const Mesh mixed = mesh_of(positions, triangles);
  expect_as_plain(random_triangles(200, 8), mixed);
  expect_as_plain(mixed, random_triangles(60, 9));
}

// Whatever the guess, there is a triangle within a distance or there is none.
TEST(Distance, WithinABoundIsThatOfAPlainSearch) {
  const Mesh mesh = random_triangles(300, 5);
  const TriangleGrid grid(mesh, {});
  std::mt19937 random(6);
  std::uniform_real_distribution<double> place(-7, 7);
  std::uniform_int_distribution<std::uint32_t> any(0, 299);
  int found = 0;
  for (int i = 0; i < 300; ++i) {
    const Point point = {place(random), place(random), place(random)};
    const double plain = plain_distance(point, mesh);
    for (const double bound : {0.1, 0.5, 1.0, 3.0, 0.999999 * plain, 1.000001 * plain}) {
      for (const std::uint32_t guess : {TriangleGrid::kNone, any(random)}) {
        const TriangleGrid::Nearest near = grid.within(point, bound * bound, guess);
        ASSERT_EQ(near.triangle != TriangleGrid::kNone, plain <= bound);
        if (near.triangle == TriangleGrid::kNone) continue;
        ++found;
        EXPECT_EQ(near.squared_mm,
                  squared_distance(point, corners_of(mesh, mesh.triangles[near.triangle])));
        EXPECT_LE(near.squared_mm, bound * bound);
      }
    }
  }
  EXPECT_GT(found, 500);
  const Mesh nothing;
  EXPECT_EQ(TriangleGrid(nothing, {}).within({0, 0, 0}, 1, TriangleGrid::kNone).triangle,
            TriangleGrid::kNone);
}

TEST(Distance, OfAMeshThatIsMovedAlongItsNormalIsTheMove) {
  constexpr double kMove = 0.375;
  const Certificate certificate = certify(sheet(30, kMove), sheet(30), {});
  for (const DistanceSummary& way : {certificate.from_mesh, certificate.from_reference}) {
    EXPECT_EQ(way.max_mm, kMove);
    EXPECT_NEAR(way.mean_mm, kMove, 1e-12);
    EXPECT_NEAR(way.rms_mm, kMove, 1e-12);
    EXPECT_EQ(way.p99_mm, kMove);
    EXPECT_EQ(way.histogram.back(), way.points);
  }
}

// A ball's vertices moved outward by d are d from it, or a little more where it is flat between.
TEST(Distance, OfABallThatHasGrownIsTheGrowth) {
  constexpr double kGrowth = 0.05;
  const Mesh before = ball(0.7, 40);
  Mesh after = ball(0.7, 40);
  for (Vec3& position : after.positions) {
    const double radius = test::length(to_point(position));
    for (float& coordinate : position) coordinate *= static_cast<float>(1 + kGrowth / radius);
  }
  const Certificate certificate = certify(after, before, {});
  EXPECT_NEAR(certificate.from_mesh.max_mm, kGrowth, 2e-3);
  EXPECT_NEAR(certificate.from_mesh.mean_mm, kGrowth, 2e-3);
  EXPECT_NEAR(certificate.from_reference.mean_mm, kGrowth, 2e-3);
  EXPECT_LE(certificate.from_reference.max_mm, kGrowth + 1e-6);
}

TEST(Distance, OfAMeshToItselfIsNothing) {
  const Mesh mesh = ball(0.7, 30);
  const Certificate certificate = certify(mesh, mesh, {});
  EXPECT_LT(certificate.max_mm(), 1e-6);
  EXPECT_EQ(certificate.from_mesh, certificate.from_reference);
}

// From the mesh's side alone a hole is not seen.
TEST(Distance, ShowsAHoleFromTheReferencesSide) {
  const Mesh whole = sheet(40);
  constexpr double kRadius = 6;
  std::vector<Triangle> triangles;
  for (const Triangle& triangle : whole.triangles) {
    const bool is_in_hole = std::ranges::any_of(triangle, [&](std::uint32_t v) {
      const Point at = to_point(whole.positions[v]);
      return std::hypot(at[0] - 20, at[1] - 20) < kRadius;
    });
    if (!is_in_hole) triangles.push_back(triangle);
  }
  const Mesh holed = mesh_of({whole.positions.begin(), whole.positions.end()}, triangles);
  const DistanceSummary seen = measure_distance(whole, TriangleGrid(holed, {}), {});
  EXPECT_GE(seen.max_mm, kRadius - 1e-6);
  EXPECT_LE(seen.max_mm, kRadius + std::sqrt(2));
  EXPECT_LT(measure_distance(holed, TriangleGrid(whole, {}), {}).max_mm, 1e-6);
}

TEST(Distance, IsTheSameOnAnyNumberOfThreads) {
  const Mesh a = ball(0.95, 76);
  const Mesh b = ball(0.94, 70);
  ASSERT_GT(a.triangles.size(), 33'000U);  // several slabs
  const auto certificate = test::expect_same_on_any_threads([&] { return certify(a, b, {}); });
  EXPECT_GT(certificate.max_mm(), 0);
}

TEST(Distance, OfManyPointsIsMeasuredAtRunsOfThem) {
  const Mesh from = ball(0.95, 40);
  const Mesh to = ball(0.9, 40);
  const TriangleGrid grid(to, {});
  const DistanceSummary all = measure_distance(from, grid, {});
  for (const std::size_t most : {256U, 1000U, 5000U}) {
    ASSERT_LT(most, all.points);
    const DistanceSummary some = measure_distance(from, grid, {}, most);
    EXPECT_LE(some.points, most);
    EXPECT_GT(2 * some.points, most - most % 256);
    EXPECT_LE(some.max_mm, all.max_mm);
    EXPECT_NEAR(some.mean_mm, all.mean_mm, 0.1 * all.mean_mm) << most;
    EXPECT_EQ(std::reduce(some.histogram.begin(), some.histogram.end()), some.points);
  }
  EXPECT_EQ(measure_distance(from, grid, {}, all.points), all);
}

// All is looked at where the reach is too small.
TEST(Distance, OfFewPointsIsTheSameWhateverTheReach) {
  const Mesh a = ball(0.95, 60);
  const Mesh b = ball(0.93, 55);
  const Certificate whole = certify(a, b, {}, 1024);
  ASSERT_GT(whole.max_mm(), 0.01);
  for (const double reach : {1e-9, 0.01, whole.max_mm(), 0.1, 5.0}) {
    EXPECT_EQ(certify(a, b, {}, 1024, reach), whole) << reach;
  }
}

TEST(Distance, OfVerticesComesInTheirOrder) {
  const Mesh from = random_triangles(100, 1);
  const Mesh to = random_triangles(100, 2);
  Buffer<float> distances;
  measure_vertex_distances(from, TriangleGrid(to, {}), {}, distances);
  ASSERT_EQ(distances.size(), from.positions.size());
  for (std::size_t v = 0; v < distances.size(); ++v) {
    EXPECT_NEAR(distances[v], plain_distance(to_point(from.positions[v]), to), 1e-6) << v;
  }
}

TEST(Distance, OfNothingIsNothingAndToNothingInfinite) {
  const Mesh some = sheet(2);
  const Mesh none = mesh_of({}, {});
  const Certificate empty = certify(none, none, {});
  EXPECT_EQ(empty.from_mesh, DistanceSummary{});
  EXPECT_EQ(empty.from_reference, DistanceSummary{});
  const Certificate lost = certify(none, some, {});
  EXPECT_EQ(lost.from_mesh, DistanceSummary{});
  EXPECT_EQ(lost.from_reference.points, some.positions.size() + some.triangles.size());
  for (const double figure : {lost.from_reference.max_mm, lost.from_reference.mean_mm,
                              lost.from_reference.rms_mm, lost.from_reference.p99_mm}) {
    EXPECT_EQ(figure, std::numeric_limits<double>::infinity());
  }
  EXPECT_EQ(lost.from_reference.histogram, DistanceSummary{}.histogram);
}

// All in one point, all in one line, and one that names a vertex twice beside sound ones.
TEST(Distance, ToTrianglesWithoutAreaIsHarmless) {
  const Mesh point = mesh_of({{1, 1, 1}}, {{0, 0, 0}, {0, 0, 0}});
  EXPECT_NEAR(measure_distance(sheet(2), TriangleGrid(point, {}), {}).max_mm, std::sqrt(3), 1e-6);
  const Mesh line = mesh_of({{0, 0, 5}, {1, 0, 5}, {2, 0, 5}}, {{0, 1, 2}, {2, 1, 0}});
  expect_as_plain(sheet(4), line);
  expect_as_plain(line, sheet(4));
  const Mesh mixed =
      mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {9, 9, 9}}, {{0, 1, 2}, {3, 3, 0}, {1, 1, 1}});
  expect_as_plain(random_triangles(40, 4), mixed);
}

// Millions of empty cells between two specks, and points far from both.
TEST(Distance, OfWhatIsFarAwayIsFoundWithoutALongSearch) {
  std::vector<Vec3> positions;
  std::vector<Triangle> triangles;
  for (const float at : {0.0F, 10'000.0F}) {
    const auto first = static_cast<std::uint32_t>(positions.size());
    positions.insert(positions.end(), {{at, at, at}, {at + 0.01F, at, at}, {at, at + 0.01F, at}});
    triangles.push_back({first, first + 1, first + 2});
  }
  const Mesh specks = mesh_of(positions, triangles);
  const Mesh far = mesh_of({{-50'000, 0, 0}, {4'000, 4'000, 4'000}, {20'000, 20'000, 20'000}}, {});
  expect_as_plain(far, specks);
}

TEST(Distance, RefusesWhatIsNotANumber) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const float bad : {nan, kInfinite, -kInfinite}) {
    const Mesh broken = mesh_of({{0, 0, 0}, {1, 0, 0}, {0, bad, 0}}, {{0, 1, 2}});
    EXPECT_EQ(test::code_thrown_by([&] { certify(broken, sheet(2), {}); }),
              ErrorCode::kUnusableVolume);
    EXPECT_EQ(test::code_thrown_by([&] { certify(sheet(2), broken, {}); }),
              ErrorCode::kUnusableVolume);
  }
}

TEST(Distance, StopsWhenItIsCancelled) {
  std::stop_source stop;
  stop.request_stop();
  const Context stopped = {stop.get_token(), {}};
  EXPECT_EQ(test::code_thrown_by([&] { certify(sheet(3), sheet(3), stopped); }),
            ErrorCode::kCancelled);
}

TEST(Distance, TellsHowFarItIs) {
  double last = 0;
  const test::ThreadCount one(1);
  const Context context = {{}, [&](double share) {
                             EXPECT_GE(share, last);
                             last = share;
                           }};
  certify(ball(0.7, 30), ball(0.6, 30), context);
  EXPECT_EQ(last, 1);
}

}  // namespace
}  // namespace isomesh::mesh
