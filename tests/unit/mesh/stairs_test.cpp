// Walls without the steps of voxels, and what they lack of the voxels' volume.
#include "server/mesh/stairs/stairs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numbers>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/stairs/missing_volume.h"
#include "server/mesh/stairs/unfold.h"
#include "tests/support/any_threads.h"
#include "tests/support/points.h"
#include "tests/support/step.h"
#include "tests/unit/mesh/separated.h"

namespace isomesh::mesh {
namespace {

using test::Point;
using Labels = test::SampleVolume<std::uint8_t>;

constexpr double kUnbounded = std::numeric_limits<double>::infinity();

struct Smoothed {
  SeparatingSurface surface;
  SmoothingEffect effect;
};

Smoothed without_stairs(const Labels& volume, const SeparateOptions& options,
                        double most = kUnbounded) {
  Smoothed result;
  const auto lattice = volume.lattice();
  const SurfaceCount count = count_walls(lattice, options, {});
  extract_walls(lattice, options, count, {}, result.surface);
  result.effect = remove_stairs(lattice, options, most, {}, result.surface);
  return result;
}

SeparateOptions joined(std::size_t labels, bool close = false) {
  return {.labels = consecutive<std::int64_t>(1, labels), .close = close, .regularize = true};
}

// As many samples as cover the ball of that radius around the origin, and two more.
Labels labels_of(const std::function<int(const Point&)>& label, double radius,
                 const std::array<double, 3>& spacing) {
  Geometry geometry;
  Dims dims;
  std::uint32_t* const counts[] = {&dims.x, &dims.y, &dims.z};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto half = static_cast<std::uint32_t>(std::ceil(radius / spacing[axis])) + 2;
    *counts[axis] = 2 * half + 1;
    geometry.spacing[axis] = spacing[axis];
    geometry.origin[axis] = -static_cast<double>(half) * spacing[axis];
  }
  return test::sample<std::uint8_t>([&](const Point& p) { return label(p); }, dims, geometry);
}

std::map<std::int64_t, double> voxels_mm3(const Labels& volume) {
  std::map<std::int64_t, double> volumes;
  for (const LabelVoxels& label : count_labels(volume.lattice(), {})) {
    volumes[label.label] = label.volume_mm3;
  }
  return volumes;
}

std::vector<LabelMeasure> measured(const SeparatingSurface& surface) {
  return label_measures(surface);
}

// The volume that fans owe each label, in voxels.
std::map<std::int64_t, double> owed(const Labels& volume, const SeparateOptions& options,
                                    SeparatingSurface& surface) {
  const auto lattice = volume.lattice();
  const SurfaceCount count = count_walls(lattice, options, {});
  extract_walls(lattice, options, count, {}, surface);
  const WallShape shape(surface, lattice.dims, lattice.to_space, options.close, {});
  const Buffer<float> missing =
      missing_volume(PartsOf(lattice, surface.parts), options.scheme, surface, shape, {});
  const WallFans& fans = shape.fans();
  const Lanes spacing = shape.spacing();
  const double voxel = std::abs(double{spacing[0]} * spacing[1] * spacing[2]);
  std::map<std::int64_t, double> sums;
  for (std::size_t fan = 0; fan < fans.size(); ++fan) {
    const WallSides sides = fans.wall(fan).sides;
    sums[sides.back] += missing[fan] / voxel;
    sums[sides.front] -= missing[fan] / voxel;
  }
  return sums;
}

// Their extracted surface, of a few triangles, has a fifth to a quarter of it.
TEST(Stairs, GiveLabelsOfAFewVoxelsTheirVolume) {
  const std::vector<std::vector<std::array<int, 3>>> shapes = {
      {{4, 4, 4}},
      {{5, 4, 4}},
      {{4, 4, 4}, {5, 4, 4}, {4, 5, 4}},
      {{4, 4, 4}, {5, 4, 4}, {4, 5, 4}, {5, 5, 4}, {4, 4, 5}, {5, 4, 5}, {4, 5, 5}, {5, 5, 5}}};
  for (const Scheme scheme : {Scheme::kFive, Scheme::kSix}) {
    for (const auto& voxels : shapes) {
      auto volume = test::noise_between<std::uint8_t>(0, 0, {10, 10, 10}, 1);
      for (const auto& [x, y, z] : voxels) {
        volume.samples[static_cast<std::size_t>((z * 10 + y) * 10 + x)] = 1;
      }
      SeparateOptions options = joined(1, true);
      options.scheme = scheme;
      const double volume_mm3 = without_stairs(volume, options).effect.after.volume_mm3;
      const auto expected = static_cast<double>(voxels.size());
      EXPECT_NEAR(std::abs(volume_mm3), expected, 0.15 * expected);
    }
  }
}

// Cubes of `size` voxels in a volume of 20^3, at both ends of each axis and within.
std::vector<Labels> cubes_at_borders(int size) {
  std::vector<Labels> cubes;
  constexpr int kSamples = 20;
  const std::array<int, 3> starts = {0, 8, kSamples - size};
  for (const int z : starts) {
    for (const int y : starts) {
      for (const int x : starts) {
        auto volume = test::noise_between<std::uint8_t>(0, 0, {kSamples, kSamples, kSamples}, 1);
        for (int i = 0; i < size * size * size; ++i) {
          const int place = ((z + i / size / size) * kSamples + y + i / size % size) * kSamples + x;
          volume.samples[static_cast<std::size_t>(place + i % size)] = 1;
        }
        cubes.push_back(std::move(volume));
      }
    }
  }
  return cubes;
}

TEST(Stairs, GiveLabelsAtTheBorderTheirVolume) {
  const std::map<int, double> most_percent = {{1, 20}, {2, 4}, {3, 1}, {5, 1}, {8, 0.5}};
  for (const auto& [size, most] : most_percent) {
    const double expected = size * size * size;
    for (const Labels& volume : cubes_at_borders(size)) {
      const Smoothed smoothed = without_stairs(volume, joined(1, true));
      EXPECT_NEAR(std::abs(smoothed.effect.after.volume_mm3), expected, expected * most / 100);
    }
  }
}

// The ends of open walls, and the edges of caps, are curves of a few vertices there.
TEST(Stairs, LeaveShortCurvesTheirLength) {
  for (const bool close : {false, true}) {
    for (const Labels& volume : cubes_at_borders(1)) {
      const Smoothed smoothed = without_stairs(volume, joined(1, close));
      for (std::size_t axis = 0; axis < 3; ++axis) {
        float low = 100;
        float high = -100;
        for (const Vec3& position : smoothed.surface.mesh.positions) {
          low = std::min(low, position[axis]);
          high = std::max(high, position[axis]);
        }
        EXPECT_GT(high - low, 0.5F);
        // In a corner of the volume, the bevels leave no other place for its volume.
        EXPECT_LT(high - low, 1.9F);
      }
    }
  }
}

TEST(MissingVolume, IsThatOfTheVoxelsLessWhatTheWallsEnclose) {
  for (const Geometry& geometry : {Geometry{}, test::oblique_left_handed_geometry()}) {
    Labels noise = label_noise(4, {15, 12, 13}, 71, geometry);
    // Walls that reach the border enclose nothing.
    for (std::uint32_t k = 0; k < noise.dims.z; ++k) {
      for (std::uint32_t j = 0; j < noise.dims.y; ++j) {
        for (std::uint32_t i = 0; i < noise.dims.x; ++i) {
          const bool is_inner = i > 0 && j > 0 && k > 0 && i + 1 < noise.dims.x &&
                                j + 1 < noise.dims.y && k + 1 < noise.dims.z;
          if (!is_inner) noise.at(i, j, k) = 0;
        }
      }
    }
    const double voxel = std::abs(noise.lattice().to_space.determinant());
    for (const Scheme scheme : {Scheme::kFive, Scheme::kSix}) {
      for (const bool regularize : {false, true}) {
        SCOPED_TRACE(testing::Message() << static_cast<int>(scheme) << ' ' << regularize);
        SeparateOptions options = joined(3);
        options.scheme = scheme;
        options.regularize = regularize;
        SeparatingSurface surface;
        const auto sums = owed(noise, options, surface);
        const auto voxels = voxels_mm3(noise);
        for (const LabelMeasure& label : measured(surface)) {
          const double missing = voxels.at(label.label) - label.extent.volume_mm3;
          EXPECT_NEAR(sums.at(label.label) * voxel, missing, 2e-4 * voxels.at(label.label));
        }
      }
    }
  }
}

struct Shape {
  std::string name;
  std::array<double, 3> spacing;
  double area_percent;
  double volume_percent;
  std::size_t folded;
};

class RoundShapes : public testing::TestWithParam<Shape> {
 protected:
  static constexpr double kRadius = 10;

  // The mean over some places of the centre, none of them special to the lattice.
  void expect_near(const std::function<double(const Point&)>& outside, double reach,
                   double area) const {
    constexpr std::array<Point, 4> kPlaces = {Point{0.31, -0.22, 0.41}, Point{-0.13, 0.47, -0.29},
                                              Point{0.05, 0.12, -0.4}, Point{-0.37, -0.08, 0.19}};
    double area_error = 0;
    for (std::size_t n = 0; n < kPlaces.size(); n += test::kStep) {
      const Point& place = kPlaces[n];
      const auto label = [&](const Point& p) {
        Point from;
        for (std::size_t i = 0; i < 3; ++i) from[i] = p[i] - place[i] * GetParam().spacing[i];
        return outside(from) <= 0 ? 1 : 0;
      };
      const Labels volume = labels_of(label, reach, GetParam().spacing);
      const Smoothed smoothed = without_stairs(volume, joined(1));
      const auto lattice = volume.lattice();
      const WallShape shape(smoothed.surface, lattice.dims, lattice.to_space, false, {});
      EXPECT_LE(count_folded(shape, {}), GetParam().folded);
      const Extent extent = measure_extent(smoothed.surface.mesh, {});
      const double voxels = voxels_mm3(volume).at(1);
      EXPECT_NEAR(extent.volume_mm3 / voxels, 1, GetParam().volume_percent / 100);
      area_error += (extent.area_mm2 / area - 1) / kPlaces.size();
    }
    if (test::kStep == 1) {
      EXPECT_LT(std::abs(area_error), GetParam().area_percent / 100);
    }
  }
};

TEST_P(RoundShapes, HaveTheirAreaAndTheirVoxelsVolume) {
  const auto ball = [](const Point& p) { return test::length(p) - kRadius; };
  expect_near(ball, kRadius, 4 * std::numbers::pi * kRadius * kRadius);
  // A ring around an axis that is oblique to the lattice.
  constexpr double kRing = 2.5 * kRadius;
  const Point axis = {0.48, 0.36, 0.8};
  const auto tube = [&](const Point& p) {
    const double along = test::dot(p, axis);
    Point across;
    for (std::size_t i = 0; i < 3; ++i) across[i] = p[i] - along * axis[i];
    return std::hypot(along, test::length(across) - kRing) - kRadius;
  };
  expect_near(tube, kRing + kRadius, 4 * std::numbers::pi * std::numbers::pi * kRing * kRadius);
}

INSTANTIATE_TEST_SUITE_P(Spacings, RoundShapes,
                         testing::Values(Shape{"even", {1, 1, 1}, 0.4, 0.1, 0},
                                         Shape{"double", {1, 1, 2}, 0.6, 0.1, 0},
                                         Shape{"triple", {1, 1, 3}, 0.7, 0.15, 1}),
                         [](const auto& test) { return test.param.name; });

TEST(Stairs, OfABoxAreNone) {
  const auto label = [](const Point& p) {
    return std::abs(p[0]) < 10.5 && std::abs(p[1]) < 8.5 && std::abs(p[2]) < 7.5 ? 1 : 0;
  };
  const Smoothed smoothed = without_stairs(labels_of(label, 11, {1, 1, 1}), joined(1));
  constexpr double kFromEdges = 3;
  std::size_t seen = 0;
  for (const Vec3& at : smoothed.surface.mesh.positions) {
    const Point beyond = {std::abs(at[0]) - 10.5, std::abs(at[1]) - 8.5, std::abs(at[2]) - 7.5};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (beyond[(axis + 1) % 3] > -kFromEdges || beyond[(axis + 2) % 3] > -kFromEdges) continue;
      EXPECT_NEAR(beyond[axis], 0, 0.05);
      ++seen;
    }
  }
  EXPECT_GT(seen, 500U);
}

// The wall ends in a groove of the faces, which is no reason to move all around it outward.
TEST(Stairs, OfABoxInTwoHalvesAreNone) {
  const auto label = [](const Point& p) {
    if (std::abs(p[0]) > 12 || std::abs(p[1]) > 12 || std::abs(p[2]) > 12) return 0;
    return p[0] < 0 ? 1 : 2;
  };
  const Smoothed smoothed = without_stairs(labels_of(label, 13, {1, 1, 1}), joined(2));
  constexpr double kFace = 12.5;
  std::size_t seen = 0;
  for (const Vec3& at : smoothed.surface.mesh.positions) {
    const double beyond = std::abs(at[2]) - kFace;
    const double edge = kFace - std::max(std::abs(at[0]), std::abs(at[1]));
    if (beyond < -0.75 || edge < 2 || std::abs(at[0]) < 2) continue;
    EXPECT_NEAR(beyond, 0, edge < 5 ? 0.15 : 0.05) << at[0] << ' ' << at[1];
    ++seen;
  }
  EXPECT_GT(seen, 500U);
}

TEST(Stairs, LeaveWhatIsThinItsVolume) {
  const Point axis = {0.48, 0.36, 0.8};
  const auto is_voxel = [](const Point& p) { return test::length(p) < 0.5 ? 1 : 0; };
  const auto sheet = [&](const Point& p) {
    return std::abs(test::dot(p, axis)) < 0.75 && test::length(p) < 10 ? 1 : 0;
  };
  const auto thread = [&](const Point& p) {
    const double along = test::dot(p, axis);
    return std::abs(along) < 10 && test::dot(p, p) - along * along < 0.81 ? 1 : 0;
  };
  for (const std::function<int(const Point&)>& label :
       std::vector<std::function<int(const Point&)>>{is_voxel, sheet, thread}) {
    const Labels volume = labels_of(label, 10, {1, 1, 1});
    const Smoothed smoothed = without_stairs(volume, joined(1));
    const double part = smoothed.effect.after.volume_mm3 / voxels_mm3(volume).at(1);
    EXPECT_GT(part, 0.7);
    EXPECT_LT(part, 1.3);
  }
}

TEST(Stairs, OfManyLabelsLeaveEachItsVolume) {
  const Labels volume = label_cells(9, {44, 40, 42}, 15, 31);
  const auto voxels = voxels_mm3(volume);
  for (const bool close : {false, true}) {
    const Smoothed smoothed = without_stairs(volume, joined(9, close));
    for (const LabelMeasure& label : measured(smoothed.surface)) {
      EXPECT_TRUE(label.topology.manifold && label.topology.oriented);
      EXPECT_EQ(label.is_closed() || !close, true);
      if (!label.is_closed() || voxels.at(label.label) < 1000) continue;
      // Caps bevel the edges of the volume's box.
      EXPECT_NEAR(label.extent.volume_mm3 / voxels.at(label.label), 1, close ? 0.02 : 0.005);
    }
  }
}

TEST(Stairs, LeaveCapsFlatAndEndsInTheBorder) {
  const Labels volume = label_cells(7, {20, 17, 23}, 15, 5);
  for (const bool close : {false, true}) {
    const double beyond = close ? 0.5 : 0;
    SeparatingSurface before;
    separate_into(before, volume, joined(7, close));
    const Smoothed smoothed = without_stairs(volume, joined(7, close));
    const std::array<double, 3> last = {19 + beyond, 16 + beyond, 22 + beyond};
    std::size_t seen = 0;
    for (std::size_t v = 0; v < before.mesh.positions.size(); ++v) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const float was = before.mesh.positions[v][axis];
        const float is = smoothed.surface.mesh.positions[v][axis];
        if (was == -beyond || was == last[axis]) {
          EXPECT_EQ(is, was);
          ++seen;
        }
        EXPECT_TRUE(std::isfinite(is));
      }
    }
    EXPECT_GT(seen, 100U);
  }
}

TEST(Stairs, LeaveWallsWithinTheVolume) {
  for (const Labels& volume :
       {label_cells(7, {20, 17, 23}, 15, 5), label_noise(3, {20, 17, 23}, 3)}) {
    for (const bool close : {false, true}) {
      const double beyond = close ? 0.5 : 0;
      const Smoothed smoothed = without_stairs(volume, joined(7, close));
      for (const Vec3& position : smoothed.surface.mesh.positions) {
        const std::array<float, 3> last = {19, 16, 22};
        for (std::size_t axis = 0; axis < 3; ++axis) {
          ASSERT_GE(position[axis], -beyond);
          ASSERT_LE(position[axis], last[axis] + beyond);
        }
      }
    }
  }
}

TEST(Stairs, AreTheSameToTheByteOnAnyNumberOfThreads) {
  const Labels volume = label_cells(12, {30, 33, 50}, 14, 9);
  test::expect_same_on_any_threads([&] { return without_stairs(volume, joined(12, true)); },
                                   [](const Smoothed& a, const Smoothed& b) {
                                     return same_bytes(a.surface, b.surface) &&
                                            a.effect.mean_displacement_mm ==
                                                b.effect.mean_displacement_mm;
                                   });
}

// Far from the origin, steps of single precision are a tenth of the limit.
TEST(Stairs, MoveNothingFartherThanIsAllowed) {
  for (const double away : {0.0, 1e5}) {
    Geometry geometry = test::oblique_left_handed_geometry();
    for (double& coordinate : geometry.origin) coordinate += away;
    const Labels volume = label_noise(3, {14, 13, 12}, 3, geometry);
    SeparatingSurface before;
    separate_into(before, volume, joined(2));
    constexpr double kMost = 0.1;
    const Smoothed smoothed = without_stairs(volume, joined(2), kMost);
    double largest = 0;
    double sum = 0;
    for (std::size_t v = 0; v < before.mesh.positions.size(); ++v) {
      Point way;
      for (std::size_t i = 0; i < 3; ++i) {
        way[i] = double{smoothed.surface.mesh.positions[v][i]} - before.mesh.positions[v][i];
      }
      largest = std::max(largest, test::length(way));
      sum += test::length(way);
    }
    EXPECT_GT(largest, kMost / 2);
    EXPECT_LE(largest, kMost);
    EXPECT_DOUBLE_EQ(smoothed.effect.max_displacement_mm, largest);
    const double mean = sum / static_cast<double>(before.mesh.positions.size());
    EXPECT_NEAR(smoothed.effect.mean_displacement_mm, mean, 1e-9);
  }
}

// Far from the origin, single precision leaves them beside the planes in which they are.
TEST(Stairs, KeepCapsFlatFarFromTheOrigin) {
  for (const double away : {0.0, 1e4, -1.9e4}) {
    Geometry geometry;
    geometry.spacing = {0.3, 0.3, 0.3};
    geometry.origin = {away, away, away};
    Labels volume = test::constant<std::uint8_t>(0, {24, 24, 16});
    volume.geometry = geometry;
    for (std::uint32_t k = 0; k < 16; ++k) {
      for (std::uint32_t j = 0; j < 24; ++j) {
        for (std::uint32_t i = 0; i < 24; ++i) {
          if (std::hypot(i - 12.0, j - 12.0, k - 3.0) < 9.3) volume.at(i, j, k) = i < 11 ? 1 : 2;
        }
      }
    }
    SeparatingSurface before;
    separate_into(before, volume, joined(2, true));
    const Smoothed smoothed = without_stairs(volume, joined(2, true));
    std::size_t in_cap = 0;
    for (std::size_t v = 0; v < before.mesh.positions.size(); ++v) {
      const float start = before.mesh.positions[v][2];
      if (start > away - 0.1) continue;
      ++in_cap;
      EXPECT_EQ(smoothed.surface.mesh.positions[v][2], start) << away;
    }
    EXPECT_GT(in_cap, 200U);
  }
}

// Blocks of a volume will be worked on by themselves.
TEST(Stairs, DependOnlyOnWhatIsNear) {
  constexpr std::uint32_t kChanged = 75;
  constexpr double kReach = 60;  // layers
  constexpr Dims dims = {16, 17, 140};
  Labels volume = label_cells(40, dims, 14, 77);
  const Smoothed first = without_stairs(volume, joined(40));
  const Labels other = label_noise(5, dims, 78);
  for (std::uint32_t k = kChanged; k < dims.z; ++k) {
    for (std::uint32_t j = 0; j < dims.y; ++j) {
      for (std::uint32_t i = 0; i < dims.x; ++i)
        volume.at(i, j, k) = other.samples[i + dims.x * (j + dims.y * k)];
    }
  }
  const Smoothed second = without_stairs(volume, joined(40));
  std::map<Vec3, Vec3> moved;
  SeparatingSurface start;
  separate_into(start, volume, joined(40));
  for (std::size_t v = 0; v < start.mesh.positions.size(); ++v) {
    moved[start.mesh.positions[v]] = second.surface.mesh.positions[v];
  }
  const Labels unchanged = label_cells(40, dims, 14, 77);
  separate_into(start, unchanged, joined(40));
  double farthest = 0;
  std::size_t same = 0;
  for (std::size_t v = 0; v < start.mesh.positions.size(); ++v) {
    const Vec3& from = start.mesh.positions[v];
    if (from[2] > kChanged) break;
    const auto found = moved.find(from);
    if (found != moved.end() && found->second == first.surface.mesh.positions[v]) {
      ++same;
    } else {
      farthest = std::max(farthest, kChanged - double{from[2]});
    }
  }
  RecordProperty("farthest", std::to_string(farthest));
  EXPECT_LT(farthest, kReach);
  EXPECT_GT(same, 1000U);
}

TEST(Stairs, OfNothingAreNothing) {
  const Labels empty = test::constant<std::uint8_t>(0, {5, 5, 5});
  const Smoothed smoothed = without_stairs(empty, joined(1));
  EXPECT_EQ(smoothed.surface.mesh.positions.size(), 0U);
  EXPECT_EQ(smoothed.effect.max_displacement_mm, 0);
}

}  // namespace
}  // namespace isomesh::mesh
