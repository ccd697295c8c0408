#include "server/mesh/measure/diameter.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/points.h"
#include "tests/support/errors.h"

namespace isomesh::mesh {
namespace {

using Points = std::vector<Vec3>;

// Every pair, in long double.
double by_all_pairs(const Points& points) {
  long double largest = 0;
  for (const Vec3& a : points) {
    for (const Vec3& b : points) {
      long double sum = 0;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const long double between = static_cast<long double>(a[axis]) - b[axis];
        sum += between * between;
      }
      largest = std::max(largest, sum);
    }
  }
  return static_cast<double>(std::sqrt(largest));
}

double measured(Points points) { return largest_distance(points, {}); }

class PointsOf {
 public:
  explicit PointsOf(unsigned seed) : random_(seed) {}

  Points box(std::size_t count, const Vec3& sides) {
    Points points(count);
    for (Vec3& point : points) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        point[axis] = static_cast<float>(uniform_(random_)) * sides[axis];
      }
    }
    return points;
  }

  // On an ellipsoid: with equal axes each point has a partner at almost the largest distance.
  Points ellipsoid(std::size_t count, const Vec3& axes, const Vec3& centre) {
    Points points(count);
    for (Vec3& point : points) {
      Point p = {normal_(random_), normal_(random_), normal_(random_)};
      const double length = std::sqrt(dot(p, p));
      for (std::size_t axis = 0; axis < 3; ++axis) {
        point[axis] = centre[axis] + axes[axis] * static_cast<float>(p[axis] / length);
      }
    }
    return points;
  }

 private:
  std::mt19937 random_;
  std::uniform_real_distribution<double> uniform_{-1, 1};
  std::normal_distribution<double> normal_;
};

TEST(LargestDistance, IsThatOfAllPairs) {
  for (unsigned seed = 0; seed < 30; ++seed) {
    PointsOf points(seed);
    const float flat = seed % 3 == 0 ? 0 : 5;
    for (const Points& cloud : {points.box(2 + std::size_t{seed} * 17, {3, 4, flat}),
                                points.ellipsoid(400, {7, 7, 7}, {100, -200, 300}),
                                points.ellipsoid(400, {9, 3, flat}, {0, 0, 0})}) {
      EXPECT_DOUBLE_EQ(measured(cloud), by_all_pairs(cloud)) << seed;
    }
  }
}

// Many pairs have the largest distance, and many points are equal.
TEST(LargestDistance, OfPointsOnALatticeIsItsDiagonal) {
  Points points;
  for (int n = 0; n < 3 * 8 * 8 * 8; ++n) {
    points.push_back(
        {static_cast<float>(n % 8), static_cast<float>(n / 8 % 8), static_cast<float>(n / 64 % 8)});
  }
  EXPECT_DOUBLE_EQ(measured(points), 7 * std::numbers::sqrt3);
}

// Two clusters, of which each point of one is as far from each point of the other as any: the ends
// of a spindle of arcs around the other end.
TEST(LargestDistance, OfArcsAroundEachOtherIsTheirRadius) {
  Points points;
  for (int n = -300; n <= 300; ++n) {
    const double angle = n * 1e-3;
    const auto aside = static_cast<float>(std::sin(angle) * 50);
    const auto along = static_cast<float>(std::cos(angle) * 50);
    points.push_back({aside, 0, along - 50});
    points.push_back({0, aside, 50 - along});
    points.push_back({0, aside * 0.01F, along});
  }
  EXPECT_DOUBLE_EQ(measured(points), by_all_pairs(points));
}

// The time of all pairs would be 10'000 times as long.
TEST(LargestDistance, OfASphereIsFoundInTime) {
  const Points sphere = PointsOf(7).ellipsoid(200'000, {50, 50, 50}, {0, 0, 0});
  const double diameter = measured(sphere);
  EXPECT_GT(diameter, 99.99);
  EXPECT_LT(diameter, 100.0001);
}

TEST(LargestDistance, OfFewPointsIsZero) {
  EXPECT_EQ(measured({}), 0);
  EXPECT_EQ(measured({{1, 2, 3}}), 0);
  EXPECT_EQ(measured({{1, 2, 3}, {1, 2, 3}}), 0);
  EXPECT_EQ(measured(Points(1000, {1, 2, 3})), 0);
}

TEST(LargestDistance, NeedsFinitePoints) {
  const float infinite = std::numeric_limits<float>::infinity();
  EXPECT_EQ(test::code_thrown_by([&] {
              measured({{0, 0, 0}, {0, infinite, 0}});
            }),
            ErrorCode::kUnusableVolume);
}

TEST(LargestDistance, EndsWhenItIsStopped) {
  std::stop_source stop;
  stop.request_stop();
  Points sphere = PointsOf(1).ellipsoid(1000, {1, 1, 1}, {0, 0, 0});
  EXPECT_EQ(test::code_thrown_by([&] { largest_distance(sphere, stop.get_token()); }),
            ErrorCode::kCancelled);
}

}  // namespace
}  // namespace isomesh::mesh
