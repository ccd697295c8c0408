// Smoothing that enlarges angles.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/measure/distance.h"
#include "server/mesh/smooth/smooth.h"
#include "tests/support/kernels.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/points.h"
#include "tests/support/shapes.h"

namespace isomesh::mesh {
namespace {

using test::copy_of;
using test::cross;
using test::dot;
using test::length;
using test::method_options;
using test::minus;
using test::Point;

Point plus(const Point& a, const Point& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
Point times(double s, const Point& a) { return {s * a[0], s * a[1], s * a[2]}; }
Point unit(const Point& a) { return length(a) > 0 ? times(1 / length(a), a) : a; }
Point point(const Vec3& a) { return {a[0], a[1], a[2]}; }

// In degrees, ascending: the smallest angle of each triangle.
std::vector<double> smallest_angles(const Mesh& mesh) {
  std::vector<double> angles;
  for (const Triangle& triangle : mesh.triangles) {
    double largest_cosine = -1;
    for (std::size_t i = 0; i < 3; ++i) {
      const Point at = point(mesh.positions[triangle[i]]);
      const Point a = unit(minus(point(mesh.positions[triangle[(i + 1) % 3]]), at));
      const Point b = unit(minus(point(mesh.positions[triangle[(i + 2) % 3]]), at));
      largest_cosine = std::max(largest_cosine, dot(a, b));
    }
    angles.push_back(std::acos(std::min(largest_cosine, 1.0)) * 180 / M_PI);
  }
  std::ranges::sort(angles);
  return angles;
}

Mesh ball(double radius, Scheme scheme, bool regularize) {
  const auto side = static_cast<std::uint32_t>(2 * radius + 5);
  const double middle = radius + 2;
  return test::extracted(
      test::sample<float>(test::sphere({middle + 0.13, middle - 0.21, middle + 0.07}, radius),
                          {side, side, side}),
      {.scheme = scheme, .regularize = regularize});
}

SmoothOptions options_of(Smoothing method) { return method_options(method, 5); }

struct Ball {
  Scheme scheme;
  bool regularize;
  Smoothing method;
  double hundredth_deg;  // that 99 of 100 triangles have at least
  double least_deg;
};

class QualityOfBalls : public testing::TestWithParam<Ball> {};

TEST_P(QualityOfBalls, GrowsAndLeavesTheSurfaceWhereItIs) {
  const auto [scheme, regularize, method, hundredth_deg, least_deg] = GetParam();
  const Mesh extracted = ball(27.3, scheme, regularize);
  Mesh mesh = copy_of(extracted);
  const SmoothingEffect effect = smooth(options_of(method), {}, mesh);
  const std::vector<double> angles = smallest_angles(mesh);
  EXPECT_GE(angles[angles.size() / 100], hundredth_deg);
  EXPECT_GE(angles.front(), least_deg);
  EXPECT_NEAR(effect.after.volume_mm3 / effect.before.volume_mm3, 1, 1e-5);
  const Certificate distances =
      certify({mesh.positions.span(), mesh.triangles.span()},
              {extracted.positions.span(), extracted.triangles.span()}, {});
  EXPECT_LT(distances.max_mm(), 0.05);  // of a voxel
  EXPECT_GT(effect.max_displacement_mm, effect.mean_displacement_mm);
  EXPECT_LT(effect.max_displacement_mm, 1.5);
  EXPECT_TRUE(test::is_sound(test::surface_of(mesh)));
}

// As extracted with six tetrahedra, one in a hundred triangles has less than one degree.
INSTANTIATE_TEST_SUITE_P(Schemes, QualityOfBalls,
                         testing::Values(Ball{Scheme::kSix, false, Smoothing::kAngle, 18, 0},
                                         Ball{Scheme::kSix, false, Smoothing::kOptimize, 20, 16},
                                         Ball{Scheme::kSix, true, Smoothing::kAngle, 26, 23},
                                         Ball{Scheme::kSix, true, Smoothing::kOptimize, 25, 24},
                                         Ball{Scheme::kFive, false, Smoothing::kAngle, 32, 20},
                                         Ball{Scheme::kFive, false, Smoothing::kOptimize, 28, 24},
                                         Ball{Scheme::kFive, true, Smoothing::kAngle, 25, 23},
                                         Ball{Scheme::kFive, true, Smoothing::kOptimize, 25, 24}));

// One pass of `angle`, one vertex after the other in double precision, with the extracted surface
// searched as a whole.
class NaivePass {
 public:
  explicit NaivePass(const Mesh& mesh) : mesh_(mesh) {
    for (const Vec3& position : mesh.positions) extracted_.push_back(point(position));
    positions_ = extracted_;
    for (const auto& [a, b, c] : mesh.triangles) {
      for (const auto& [at, next, previous] : {std::array{a, b, c}, {b, c, a}, {c, a, b}}) {
        spokes_.resize(positions_.size());
        spokes_[at].emplace_back(next, previous);
      }
    }
  }

  const std::vector<Point>& run() {
    for (const std::size_t parity : {0, 1}) {
      for (std::size_t layer = 4 * parity; layer < mesh_.layers(); layer += 8) move_slab(layer);
    }
    return positions_;
  }

 private:
  using Fan = std::vector<Point>;

  void move_slab(std::size_t layer) {
    const std::uint64_t first = mesh_.layer_vertices[layer];
    const std::uint64_t end = mesh_.layer_vertices[std::min(layer + 4, mesh_.layers())];
    std::vector<int> colors(end - first);
    for (std::uint64_t v = first; v < end; ++v) {
      std::uint64_t taken = 0;
      for (const auto& [next, previous] : spokes_[v]) {
        if (next >= first && next < v) taken |= std::uint64_t{1} << colors[next - first];
      }
      colors[v - first] = std::countr_one(taken);
    }
    for (int color = 0; color < 64; ++color) {
      for (std::uint64_t v = first; v < end; ++v) {
        if (colors[v - first] == color) move(v);
      }
    }
  }

  Fan fan_of(std::uint64_t vertex) const {
    Fan fan;
    std::uint32_t at = spokes_[vertex].front().first;
    for (std::size_t i = 0; i < spokes_[vertex].size(); ++i) {
      fan.push_back(positions_[at]);
      at =
          std::ranges::find(spokes_[vertex], at, [](const auto& two) { return two.first; })->second;
    }
    return fan;
  }

  void move(std::uint64_t vertex) {
    const Fan fan = fan_of(vertex);
    const Point at = positions_[vertex];
    Point normal = {0, 0, 0};
    double mean_length = 0;
    for (std::size_t i = 0; i < fan.size(); ++i) {
      normal = plus(normal, cross(minus(fan[i], at), minus(fan[(i + 1) % fan.size()], at)));
      mean_length += length(minus(fan[i], at)) / static_cast<double>(fan.size());
    }
    normal = unit(normal);
    const Point to = plus(at, towards_bisectors(fan, at, normal));
    const auto below = over(to, normal);
    if (!below) return;
    const Point goal = length(minus(to, *below)) <= 0.02 * mean_length ? to : *below;
    for (std::size_t i = 0; i < fan.size(); ++i) {
      const Point& next = fan[(i + 1) % fan.size()];
      const Point old_area = cross(minus(fan[i], at), minus(next, at));
      const Point area = cross(minus(fan[i], goal), minus(next, goal));
      if (dot(area, normal) <= 0 && dot(old_area, normal) > 0) return;
    }
    for (const auto& [apex, place] : {std::pair{goal, at}, std::pair{at, goal}}) {
      if (distance_from_fan(fan, apex, place, normal) > 0.1 * mean_length) return;
    }
    positions_[vertex] = goal;
  }

  static Point towards_bisectors(const Fan& fan, const Point& at, const Point& normal) {
    Point sum = {0, 0, 0};
    double weights = 0;
    for (std::size_t i = 0; i < fan.size(); ++i) {
      const Point to_next = unit(minus(fan[(i + 1) % fan.size()], fan[i]));
      const Point from_last = unit(minus(fan[i], fan[(i + fan.size() - 1) % fan.size()]));
      const Point bisector = unit(cross(normal, plus(to_next, from_last)));
      const double weight = 1 / (1.05 + dot(to_next, from_last));
      const Point goal = plus(fan[i], times(length(minus(fan[i], at)), bisector));
      sum = plus(sum, times(weight, minus(goal, at)));
      weights += weight;
    }
    const Point way = times(1 / weights, sum);
    return minus(way, times(dot(way, normal), normal));
  }

  // The point where the line through `from` meets a triangle.
  static std::optional<Point> meeting(const Point& from, const Point& along, const Point& a,
                                      const Point& b, const Point& c) {
    const double area = dot(along, cross(minus(b, a), minus(c, a)));
    if (area <= 0) return {};
    const double s = dot(along, cross(minus(from, a), minus(c, a))) / area;
    const double t = dot(along, cross(minus(b, a), minus(from, a))) / area;
    if (s < 0 || t < 0 || s + t > 1) return {};
    return plus(a, plus(times(s, minus(b, a)), times(t, minus(c, a))));
  }

  std::optional<Point> over(const Point& from, const Point& along) const {
    std::optional<Point> nearest;
    for (const auto& [a, b, c] : mesh_.triangles) {
      const auto at = meeting(from, along, extracted_[a], extracted_[b], extracted_[c]);
      if (!at) continue;
      if (!nearest || length(minus(*at, from)) < length(minus(*nearest, from))) nearest = at;
    }
    return nearest;
  }

  static double distance_from_fan(const Fan& fan, const Point& apex, const Point& from,
                                  const Point& along) {
    double nearest = 1e30;
    for (std::size_t i = 0; i < fan.size(); ++i) {
      const auto at = meeting(from, along, apex, fan[i], fan[(i + 1) % fan.size()]);
      if (at) nearest = std::min(nearest, length(minus(*at, from)));
    }
    return nearest;
  }

  const Mesh& mesh_;
  std::vector<Point> extracted_;
  std::vector<Point> positions_;
  std::vector<std::vector<std::pair<std::uint32_t, std::uint32_t>>> spokes_;
};

TEST(QualityByAngle, MovesVerticesAsTheNaiveWayDoes) {
  for (const bool regularize : {false, true}) {
    SCOPED_TRACE(regularize ? "regularised" : "plain");
    Mesh mesh = ball(6.3, Scheme::kSix, regularize);
    const Mesh before = copy_of(mesh);
    const std::vector<Point> expected = NaivePass(before).run();
    smooth(method_options(Smoothing::kAngle, 1), {}, mesh);
    std::size_t moved = 0;
    std::size_t different = 0;  // a comparison that rounding turns changes what comes after it
    for (std::size_t v = 0; v < expected.size(); ++v) {
      different += length(minus(point(mesh.positions[v]), expected[v])) > 1e-3 ? 1 : 0;
      moved += mesh.positions[v] != before.positions[v] ? 1 : 0;
    }
    EXPECT_GT(moved, expected.size() * 9 / 10);
    EXPECT_LE(different, expected.size() / 50);
  }
}

}  // namespace
}  // namespace isomesh::mesh
