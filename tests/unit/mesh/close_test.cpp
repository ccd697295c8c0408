// Surfaces that are closed where they meet the border of the volume.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/extract/extract.h"
#include "server/mesh/measure/self_intersections.h"
#include "server/mesh/smooth/smooth.h"
#include "tests/support/any_threads.h"
#include "tests/support/points.h"
#include "tests/support/shapes.h"
#include "tests/unit/mesh/reference_surface.h"

namespace isomesh::mesh {
namespace {

using test::cross;
using test::dot;
using test::minus;
using test::SampleVolume;
using test::Surface;

// Checks what must hold for every closed mesh: it is sound, has no boundary and lies within the
// volume's box. It has caps in the faces of the box if and only if it has border vertices.
void expect_closed(const Mesh& mesh, const Dims& dims, const LatticeToSpace& map) {
  const Surface surface = test::surface_of(mesh);
  EXPECT_TRUE(test::is_sound(surface));
  EXPECT_TRUE(test::topology_of(surface).boundary_edges.empty());

  // In units of the lattice, where faces are easy to tell; a left-handed map turns triangles over.
  Surface in_lattice = surface;
  for (test::Point& point : in_lattice.points) point = test::to_lattice(map, point);
  const double hand = map.determinant() < 0 ? -1 : 1;
  constexpr double kTolerance = 1e-3;
  const std::array<double, 3> high = {dims.x - 1.0, dims.y - 1.0, dims.z - 1.0};
  std::size_t caps = 0;
  for (const auto& [a, b, c] : in_lattice.triangles) {
    if (!mesh.is_on_border(a) || !mesh.is_on_border(b) || !mesh.is_on_border(c)) continue;
    const auto& points = in_lattice.points;
    const test::Point normal = cross(minus(points[b], points[a]), minus(points[c], points[a]));
    std::size_t axis = 0;
    for (const std::size_t other : {1U, 2U}) {
      if (std::abs(normal[other]) > std::abs(normal[axis])) axis = other;
    }
    const double side = hand * normal[axis] < 0 ? -1 : 1;
    const double face = side < 0 ? 0 : high[axis];
    const auto is_in_face = [&](std::uint32_t v) {
      return std::abs(points[v][axis] - face) < kTolerance;
    };
    // A triangle of the surface itself may have all its vertices on the border, but not in one
    // face.
    if (!is_in_face(a) || !is_in_face(b) || !is_in_face(c)) continue;
    ++caps;
  }
  for (const auto& point : in_lattice.points) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      ASSERT_GE(point[axis], -kTolerance);
      ASSERT_LE(point[axis], high[axis] + kTolerance);
    }
  }
  const bool has_border = std::ranges::any_of(mesh.on_border, [](auto word) { return word != 0; });
  EXPECT_EQ(caps > 0, has_border);
}

template <class T>
void expect_closed_reference_surface(const SampleVolume<T>& volume, const ExtractOptions& options) {
  SCOPED_TRACE(describe(volume.dims, options));
  test::ScalarSurface reference;
  Mesh mesh;
  ASSERT_NO_FATAL_FAILURE(extract_as_reference(volume, options, reference, mesh));
  expect_closed(mesh, volume.dims, volume.lattice().to_space);
}

template <class T>
void expect_closed_reference_surfaces(const SampleVolume<T>& volume, double iso) {
  for (const ExtractOptions& options : all_options(iso, true)) {
    expect_closed_reference_surface(volume, options);
    if (testing::Test::HasFailure()) return;
  }
}

double smallest_angle_in_degrees(const Surface& surface) {
  double smallest = 180;
  for (const auto& triangle : surface.triangles) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const test::Point& at = surface.points[triangle[corner]];
      const test::Point u = minus(surface.points[triangle[(corner + 1) % 3]], at);
      const test::Point v = minus(surface.points[triangle[(corner + 2) % 3]], at);
      const test::Point n = cross(u, v);
      smallest = std::min(smallest, std::atan2(std::sqrt(dot(n, n)), dot(u, v)));
    }
  }
  return smallest * 180 / std::numbers::pi;
}

// ---- Volumes that are inside to the border

class CloseBox : public testing::TestWithParam<test::NamedGeometry> {};

TEST_P(CloseBox, IsTheBoxOfTheOuterSamples) {
  const Geometry& geometry = GetParam().geometry;
  for (const Dims dims : {Dims{2, 2, 2}, Dims{3, 2, 2}, Dims{2, 3, 4}, Dims{4, 3, 2}, Dims{3, 3, 3},
                          Dims{5, 4, 3}, Dims{4, 5, 6}, Dims{65, 3, 4}}) {
    SampleVolume<std::uint8_t> volume = test::constant<std::uint8_t>(200, dims);
    volume.geometry = geometry;
    const LatticeToSpace map = test::space_of(geometry);
    const double cells = (dims.x - 1.0) * (dims.y - 1.0) * (dims.z - 1.0);
    const double box = cells * std::abs(map.determinant());
    for (const ExtractOptions& options : all_options(100, true)) {
      expect_closed_reference_surface(volume, options);
      SCOPED_TRACE(describe(dims, options));
      const Surface surface = test::surface_of(test::extracted(volume, options));
      EXPECT_EQ(test::topology_of(surface).euler, 2);
      EXPECT_EQ(test::topology_of(surface).components, 1U);
      EXPECT_NEAR(test::extent_of(surface, map.origin).volume, box, 1e-4 * box);
      if (HasFailure()) return;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Geometries, CloseBox, testing::ValuesIn(test::all_geometries()),
                         [](const auto& test) { return test.param.name; });

TEST(CloseBoxShape, HasNoSlivers) {
  for (const Dims dims : {Dims{2, 2, 2}, Dims{3, 3, 3}, Dims{4, 3, 2}, Dims{7, 6, 5}}) {
    const auto volume = test::constant<std::int16_t>(5, dims);
    for (const ExtractOptions& options : all_options(5, true)) {
      SCOPED_TRACE(describe(dims, options));
      const Surface surface = test::surface_of(test::extracted(volume, options));
      EXPECT_GT(smallest_angle_in_degrees(surface), 7);
      const test::ExtentFacts extent = test::extent_of(surface);
      const double x = dims.x - 1.0;
      const double y = dims.y - 1.0;
      const double z = dims.z - 1.0;
      EXPECT_NEAR(extent.area, 2 * (x * y + y * z + z * x), 1e-5);
      EXPECT_NEAR(extent.volume, x * y * z, 1e-5);
    }
  }
}

// ---- Every case of one cell, and noise

TEST(CloseCell, EveryPatternOfOneCellIsTheReferences) {
  for (unsigned pattern = 0; pattern < 256 && !testing::Test::HasFailure(); ++pattern) {
    SCOPED_TRACE(pattern);
    SampleVolume<float> volume = test::constant<float>(-3, {2, 2, 2});
    for (unsigned corner = 0; corner < 8; ++corner) {
      if ((pattern >> corner & 1U) != 0) volume.samples[corner] = 2 + static_cast<float>(corner);
    }
    expect_closed_reference_surfaces(volume, 0);
  }
}

TEST(CloseNoise, IsTheReferencesSurface) {
  for (const Dims dims :
       {Dims{2, 2, 9}, Dims{2, 9, 2}, Dims{65, 2, 2}, Dims{2, 7, 6}, Dims{7, 2, 6}, Dims{7, 6, 2},
        Dims{62, 4, 5}, Dims{63, 4, 4}, Dims{64, 3, 5}, Dims{128, 3, 3}, Dims{7, 8, 9}}) {
    for (const std::uint64_t seed : {1, 2}) {
      expect_closed_reference_surfaces(
          test::noise<std::int16_t>({-700, -20, -3, 1, 40, 900}, dims, seed), 0.5);
      // Mostly inside, so that caps have room.
      expect_closed_reference_surfaces(test::noise<std::uint8_t>({0, 3, 4, 5, 6, 7}, dims, seed),
                                       2);
      if (testing::Test::HasFailure()) return;
    }
  }
}

TEST(CloseNoise, WithSamplesThatEqualTheIsoValueIsTheReferencesSurface) {
  for (const Dims dims : {Dims{2, 2, 2}, Dims{2, 5, 4}, Dims{65, 4, 3}, Dims{9, 8, 7}}) {
    for (const std::uint64_t seed : {3, 4}) {
      expect_closed_reference_surfaces(test::noise<std::uint8_t>({0, 1, 2}, dims, seed), 1);
      expect_closed_reference_surfaces(
          test::noise<float>({0, 1 - 0x1p-24F, 1, 1 + 0x1p-23F, 1 + 1e-5F, 2}, dims, seed), 1);
    }
  }
}

TEST(CloseNoise, DoesNotIntersectItself) {
  for (const auto& [values, iso] :
       {std::pair(std::vector<std::int16_t>{-700, -20, -3, 1, 40, 900}, 0.5),
        std::pair(std::vector<std::int16_t>{0, 3, 4, 5, 6, 7}, 2.0),
        std::pair(std::vector<std::int16_t>{0, 1, 2}, 1.0)}) {
    const auto volume = test::noise(values, {20, 21, 22}, 5);
    std::vector<ExtractOptions> all = all_options(iso, true);
    all.push_back({iso, Scheme::kBcc, Interpolation::kLinear, true});
    for (const ExtractOptions& options : all) {
      const Mesh mesh = test::extracted(volume, options);
      EXPECT_EQ(find_self_intersections(mesh, {}).pairs, 0U) << describe(volume.dims, options);
    }
  }
}

template <class T>
class CloseFrom : public testing::Test {};
using SampleTypes = testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                                   std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(CloseFrom, SampleTypes);

TYPED_TEST(CloseFrom, EveryTypeIsTheReferencesSurface) {
  using Limits = std::numeric_limits<TypeParam>;
  const std::vector<TypeParam> values = {Limits::lowest(), Limits::max(), TypeParam{0},
                                         TypeParam{1}};
  const auto volume = test::noise(values, {66, 4, 4}, 10);
  expect_closed_reference_surfaces(volume, 0.5);
  // With this iso-value every sample is inside; only the phantom samples around the volume are
  // outside.
  expect_closed_reference_surfaces(volume, static_cast<double>(Limits::lowest()));
}

class CloseInGeometry : public testing::TestWithParam<test::NamedGeometry> {};

TEST_P(CloseInGeometry, NoiseIsClosed) {
  const std::vector<std::int16_t> values = {-700, -20, -3, 0, 1, 40, 900};
  const auto volume = test::noise(values, {11, 9, 10}, 17, GetParam().geometry);
  for (const double iso : {0.5, 1.0}) {
    for (const ExtractOptions& options : all_options(iso, true)) {
      SCOPED_TRACE(describe(volume.dims, options));
      expect_closed(test::extracted(volume, options), volume.dims, volume.lattice().to_space);
      if (HasFailure()) return;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Geometries, CloseInGeometry, testing::ValuesIn(test::all_geometries()),
                         [](const auto& test) { return test.param.name; });

TEST(Close, VolumesWithoutCellsHaveNoSurface) {
  for (const Dims dims :
       {Dims{1, 9, 8}, Dims{9, 1, 8}, Dims{9, 8, 1}, Dims{1, 1, 1}, Dims{0, 0, 0}}) {
    for (const ExtractOptions& options : all_options(1, true)) {
      EXPECT_EQ(test::extracted(test::constant<std::uint8_t>(9, dims), options).positions.size(),
                0U);
    }
  }
}

// ---- What closing leaves as it is

std::vector<Vec3> places_on_border(const Mesh& mesh) {
  std::vector<Vec3> places;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    if (mesh.is_on_border(v)) places.push_back(mesh.positions[v]);
  }
  return places;
}

// The vertices that are not on the border are those of the open surface, also after smoothing.
TEST(Close, DoesNotChangeWhatIsNotOnTheBorder) {
  const auto volume = test::noise_between<float>(-4, 5, {14, 12, 13}, 31);
  for (ExtractOptions options : all_options(0, true)) {
    SCOPED_TRACE(describe(volume.dims, options));
    Mesh closed = test::extracted(volume, options);
    options.close = false;
    Mesh open = test::extracted(volume, options);
    std::vector<bool> on_boundary(open.positions.size(), false);
    for (const auto& [a, b] : test::topology_of(test::surface_of(open)).boundary_edges) {
      on_boundary[a] = true;
      on_boundary[b] = true;
    }
    const std::vector<Vec3> caps = places_on_border(closed);
    for (const auto& [passes, weights] : {std::pair<int, std::vector<double>>{0, {}},
                                          {3, {1}},
                                          {2, {0.33, taubin_mu(0.33, 0.1)}}}) {
      SCOPED_TRACE(testing::Message() << passes << " passes of " << weights.size() << " steps");
      const SmoothOptions smoothing = {test::means(passes, weights)};
      for (Mesh* const mesh : {&open, &closed}) smooth(smoothing, {}, *mesh);
      std::vector<Vec3> inner_of_open;
      for (std::size_t v = 0; v < open.positions.size(); ++v) {
        if (!on_boundary[v]) inner_of_open.push_back(open.positions[v]);
      }
      std::vector<Vec3> inner_of_closed;
      for (std::size_t v = 0; v < closed.positions.size(); ++v) {
        if (!closed.is_on_border(v)) inner_of_closed.push_back(closed.positions[v]);
      }
      ASSERT_GT(inner_of_open.size(), 100U);
      EXPECT_EQ(inner_of_closed, inner_of_open);
      EXPECT_EQ(places_on_border(closed), caps) << "caps have moved";
    }
  }
}

TEST(Close, IsTheSameToTheByteOnAnyNumberOfThreads) {
  const auto volume = test::noise<std::uint8_t>({0, 3, 4, 5}, {66, 9, 60}, 32);
  for (const ExtractOptions& options : all_options(2, true)) {
    test::expect_same_on_any_threads([&] { return test::extracted(volume, options); },
                                     test::kSameBytes);
  }
}

TEST(Close, LeavesNoTraceInAMeshThatIsUsedAgain) {
  const auto volume = test::noise<std::uint8_t>({0, 3, 4, 5}, {11, 9, 8}, 33);
  ExtractOptions options = {2};
  const Mesh open = test::extracted(volume, options);
  Mesh mesh;
  options.close = true;
  test::extract_into(mesh, volume, options);
  options.close = false;
  test::extract_into(mesh, volume, options);
  EXPECT_TRUE(test::same_bytes(mesh, open));
}

// ---- Shapes whose numbers are known

class CloseShape : public testing::TestWithParam<Scheme> {
 protected:
  static test::ExtentFacts closed_extent(const test::Field& field, std::uint32_t n,
                                         std::int64_t euler) {
    const auto volume =
        test::sample<double>(field, test::unit_cube_dims(n), test::unit_cube_geometry(n));
    const Mesh mesh = test::extracted(volume, {0, GetParam(), Interpolation::kLinear, true});
    expect_closed(mesh, volume.dims, volume.lattice().to_space);
    const Surface surface = test::surface_of(mesh);
    EXPECT_EQ(test::topology_of(surface).euler, euler);
    return test::extent_of(surface, {0.1, 0.2, 0.3});
  }

  // Half the spacing, a quarter of the error.
  static void expect_quadratic(const test::Field& field, double area, double volume,
                               std::int64_t euler) {
    const auto coarse = closed_extent(field, 25, euler);
    const auto fine = closed_extent(field, 49, euler);
    for (const double ratio : {(coarse.area - area) / (fine.area - area),
                               (coarse.volume - volume) / (fine.volume - volume)}) {
      EXPECT_GT(ratio, 3.3);
      EXPECT_LT(ratio, 4.8);
    }
    EXPECT_NEAR(fine.area, area, 4e-3 * area);
    EXPECT_NEAR(fine.volume, volume, 4e-3 * volume);
  }
};

TEST_P(CloseShape, AnEighthOfABallInACorner) {
  const double radius = 1.33;
  for (const double side : {-1.0, 1.0}) {
    const double sphere = 4 * std::numbers::pi * radius * radius;
    expect_quadratic(test::sphere({side, -1, side}, radius),
                     sphere / 8 + 3 * std::numbers::pi * radius * radius / 4, sphere * radius / 24,
                     2);
  }
}

TEST_P(CloseShape, ABallCutByAFace) {
  const double radius = 0.73;
  const double height = radius - 0.37;  // of what is cut off
  const double rim = radius * radius - 0.37 * 0.37;
  const double area = 4 * std::numbers::pi * radius * radius -
                      2 * std::numbers::pi * radius * height + std::numbers::pi * rim;
  const double volume = 4 * std::numbers::pi * std::pow(radius, 3) / 3 -
                        std::numbers::pi * height * height * (3 * radius - height) / 3;
  expect_quadratic(test::sphere({0.03, 0.63, -0.05}, radius), area, volume, 2);
}

// The box without a ball: two surfaces, one inside the other.
TEST_P(CloseShape, ABoxWithAHole) {
  const double radius = 0.73;
  const double ball = 4 * std::numbers::pi * std::pow(radius, 3) / 3;
  expect_quadratic(test::scaled(test::sphere({0.03, -0.02, 0.05}, radius), -1, 0),
                   24 + 3 * ball / radius, 8 - ball, 4);
}

// A tunnel through the box along an axis, as long as the box.
TEST_P(CloseShape, ABoxWithATunnel) {
  const double radius = 0.61;
  const test::Field outside_of_cylinder = [&](const test::Point& p) {
    return std::hypot(p[0] - 0.03, p[1] + 0.02) - radius;
  };
  const double disc = std::numbers::pi * radius * radius;
  // The errors of the discs and of the tunnel's wall nearly cancel, so they show no order.
  const test::ExtentFacts extent = closed_extent(outside_of_cylinder, 49, 0);
  const double area = 24 - 2 * disc + 4 * disc / radius;
  EXPECT_NEAR(extent.area, area, 2e-3 * area);
  EXPECT_NEAR(extent.volume, 8 - 2 * disc, 2e-3 * 8);
}

// Gyroid and noise have no simple numbers, but a surface without a boundary has an even Euler
// characteristic and the volume on both of its sides.
TEST_P(CloseShape, BothSidesOfAGyroidFillTheBox) {
  const auto volume_of = [](double gain) {
    const auto samples =
        test::sample<double>(test::scaled(test::gyroid(1), gain, 0), test::unit_cube_dims(33),
                             test::unit_cube_geometry(33));
    const Mesh mesh = test::extracted(samples, {0, GetParam(), Interpolation::kLinear, true});
    expect_closed(mesh, samples.dims, samples.lattice().to_space);
    const Surface surface = test::surface_of(mesh);
    EXPECT_EQ(test::topology_of(surface).euler % 2, 0);
    EXPECT_GT(test::topology_of(surface).genus(), 4);
    return test::extent_of(surface).volume;
  };
  EXPECT_NEAR(volume_of(1) + volume_of(-1), 8, 1e-3);
}

INSTANTIATE_TEST_SUITE_P(Schemes, CloseShape, testing::Values(Scheme::kFive, Scheme::kSix),
                         [](const auto& test) {
                           return test.param == Scheme::kFive ? "Five" : "Six";
                         });

}  // namespace
}  // namespace isomesh::mesh
