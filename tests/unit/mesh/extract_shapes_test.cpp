#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/extract/extract.h"
#include "tests/support/nifti.h"
#include "tests/unit/mesh/reference_surface.h"

namespace isomesh::mesh {
namespace {

using test::Surface;

// ---- Geometry

class ExtractInGeometry : public testing::TestWithParam<test::NamedGeometry> {
 protected:
  const Geometry& geometry() const { return GetParam().geometry; }
};

TEST_P(ExtractInGeometry, NoiseIsTheReferencesSurface) {
  const std::vector<std::int16_t> values = {-700, -20, -3, 0, 1, 40, 900};
  const auto volume = test::noise(values, {21, 9, 11}, 17, geometry());
  expect_reference_surfaces(volume, 0.5);
}

TEST_P(ExtractInGeometry, SamplesThatEqualTheIsoValueGiveASoundSurface) {
  const auto volume = test::noise<std::uint8_t>({0, 1, 2}, {33, 17, 19}, 18, geometry());
  for (const ExtractOptions& options : all_options(1)) {
    SCOPED_TRACE(describe(volume.dims, options));
    EXPECT_TRUE(test::is_sound(test::surface_of(test::extracted(volume, options))));
  }
}

TEST_P(ExtractInGeometry, SamplesNextToTheIsoValueGiveASoundSurface) {
  const std::vector<float> values = {0, 1 - 0x1p-24F, 1, 1 + 0x1p-23F, 1 + 1e-5F, 2};
  const auto volume = test::noise(values, {25, 21, 19}, 23, geometry());
  for (const double iso : {1.0, 1 + 0x1p-25}) {
    for (const ExtractOptions& options : all_options(iso)) {
      SCOPED_TRACE(describe(volume.dims, options));
      EXPECT_TRUE(test::is_sound(test::surface_of(test::extracted(volume, options))));
    }
  }
}

TEST_P(ExtractInGeometry, ABallsSurfaceIsWoundOutwards) {
  const LatticeToSpace map = test::space_of(geometry());
  const double radius = 6 * *std::max_element(geometry().spacing.begin(), geometry().spacing.end());
  Dims dims;
  dims.x = static_cast<std::uint32_t>(2.5 * radius / geometry().spacing[0]);
  dims.y = static_cast<std::uint32_t>(2.5 * radius / geometry().spacing[1]);
  dims.z = static_cast<std::uint32_t>(2.5 * radius / geometry().spacing[2]);
  const test::Point centre = test::to_space(map, {dims.x / 2.0, dims.y / 2.0, dims.z / 2.0});
  const auto volume = test::sample<float>(test::sphere(centre, radius), dims, geometry());
  for (const ExtractOptions& options : all_options(0)) {
    SCOPED_TRACE(describe(dims, options));
    const Surface surface = test::surface_of(test::extracted(volume, options));
    EXPECT_TRUE(test::is_sound(surface));
    EXPECT_TRUE(test::topology_of(surface).boundary_edges.empty());
    const double ball = 4.0 / 3 * std::numbers::pi * std::pow(radius, 3);
    EXPECT_NEAR(test::extent_of(surface).volume, ball, 0.05 * ball);
    // Outwards everywhere, not only on the whole; steps of the midpoint surface can be radial.
    if (options.interpolation == Interpolation::kMidpoint) continue;
    for (const auto& [a, b, c] : surface.triangles) {
      const Surface one = {{surface.points[a], surface.points[b], surface.points[c]}, {{0, 1, 2}}};
      ASSERT_GT(test::extent_of(one, centre).volume, 0);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Geometries, ExtractInGeometry, testing::ValuesIn(test::all_geometries()),
                         [](const auto& test) { return test.param.name; });
// ---- Shapes whose numbers are known

class ExtractShape : public testing::TestWithParam<Scheme> {
 protected:
  // Area and volume of a closed surface in the cube [-1, 1]^3 on n^3 samples, whose topology is
  // checked on the way.
  static test::ExtentFacts closed_extent(const test::Field& field, std::uint32_t n,
                                         std::int64_t euler) {
    const Surface surface = extract(field, n);
    const test::TopologyFacts topology = test::topology_of(surface);
    EXPECT_TRUE(test::is_sound(surface));
    EXPECT_TRUE(topology.boundary_edges.empty());
    EXPECT_EQ(topology.components, 1U);
    EXPECT_EQ(topology.euler, euler);
    return test::extent_of(surface);
  }

  static Surface extract(const test::Field& field, std::uint32_t n) {
    const auto volume =
        test::sample<double>(field, test::unit_cube_dims(n), test::unit_cube_geometry(n));
    return test::surface_of(test::extracted(volume, {0, GetParam(), Interpolation::kLinear}));
  }

  // Half the spacing, a quarter of the error.
  static void expect_quadratic(double coarse_error, double fine_error) {
    EXPECT_GT(std::abs(coarse_error / fine_error), 3.3);
    EXPECT_LT(std::abs(coarse_error / fine_error), 4.8);
  }
};

TEST_P(ExtractShape, ASphereConvergesQuadratically) {
  const double radius = 0.73;
  const test::Field field = test::sphere({0.03, -0.02, 0.05}, radius);
  const double area = 4 * std::numbers::pi * radius * radius;
  const double volume = area * radius / 3;
  const auto coarse = closed_extent(field, 17, 2);
  const auto middle = closed_extent(field, 33, 2);
  const auto fine = closed_extent(field, 65, 2);
  expect_quadratic(coarse.area - area, middle.area - area);
  expect_quadratic(middle.area - area, fine.area - area);
  expect_quadratic(coarse.volume - volume, middle.volume - volume);
  expect_quadratic(middle.volume - volume, fine.volume - volume);
  EXPECT_NEAR(fine.area, area, 2e-3 * area);
  EXPECT_NEAR(fine.volume, volume, 2e-3 * volume);
}

TEST_P(ExtractShape, ATorusConvergesQuadratically) {
  const double major = 0.6;
  const double minor = 0.27;
  const test::Field field = test::torus({0.02, 0.03, -0.04}, major, minor);
  const double area = 4 * std::numbers::pi * std::numbers::pi * major * minor;
  const double volume = area * minor / 2;
  const auto middle = closed_extent(field, 33, 0);
  const auto fine = closed_extent(field, 65, 0);
  expect_quadratic(middle.area - area, fine.area - area);
  expect_quadratic(middle.volume - volume, fine.volume - volume);
  EXPECT_NEAR(fine.area, area, 5e-3 * area);
  EXPECT_NEAR(fine.volume, volume, 1e-2 * volume);
}

// One period of a gyroid has no simple area, so successive differences stand for errors.
TEST_P(ExtractShape, AGyroidConvergesQuadratically) {
  std::vector<double> areas;
  for (const std::uint32_t n : {17U, 33U, 65U}) {
    const Surface surface = extract(test::gyroid(2), n);
    EXPECT_TRUE(test::is_sound(surface));
    areas.push_back(test::extent_of(surface).area);
  }
  expect_quadratic(areas[0] - areas[1], areas[1] - areas[2]);
}

TEST_P(ExtractShape, AGyroidWithABorderAroundItIsClosed) {
  auto volume =
      test::sample<double>(test::gyroid(1), test::unit_cube_dims(48), test::unit_cube_geometry(48));
  test::set_border(volume, -1.0);
  const Surface surface =
      test::surface_of(test::extracted(volume, {0, GetParam(), Interpolation::kLinear}));
  EXPECT_TRUE(test::is_sound(surface));
  EXPECT_TRUE(test::topology_of(surface).boundary_edges.empty());
  EXPECT_GT(test::topology_of(surface).genus(), 4);
}

TEST_P(ExtractShape, ATangleCubeHasFiveHandles) {
  for (const std::uint32_t n : {24U, 32U, 41U}) closed_extent(test::tangle_cube(2.6), n, 2 - 2 * 5);
}

TEST_P(ExtractShape, APlaneIsFlatAndEndsOnTheBorder) {
  const test::Point normal = {2.0 / 7, 3.0 / 7, 6.0 / 7};
  const Surface surface = extract(test::plane(normal, 0.1), 24);
  EXPECT_TRUE(test::is_sound(surface));
  EXPECT_TRUE(test::boundary_is_on_border(surface, test::unit_cube_dims(24),
                                          test::space_of(test::unit_cube_geometry(24))));
  for (const auto& [x, y, z] : surface.points) {
    EXPECT_NEAR(normal[0] * x + normal[1] * y + normal[2] * z, 0.1, 1e-6);
  }
  EXPECT_EQ(test::topology_of(surface).euler, 1);  // a disk
  // The plane leaves the cube through its four sides only: the area is that of the cube's face
  // over the cosine.
  EXPECT_NEAR(test::extent_of(surface).area, 4 / normal[2], 1e-5);
}

TEST_P(ExtractShape, InsideOutHasTheSameAreaAndTheOppositeVolume) {
  const test::Field field = test::sphere({0.03, -0.02, 0.05}, 0.7);
  const auto outwards = closed_extent(field, 20, 2);
  const auto inwards = closed_extent(test::scaled(field, -1, 0), 20, 2);
  EXPECT_NEAR(inwards.area, outwards.area, 1e-5);
  EXPECT_NEAR(inwards.volume, -outwards.volume, 1e-5);
}

INSTANTIATE_TEST_SUITE_P(Schemes, ExtractShape, testing::Values(Scheme::kFive, Scheme::kSix),
                         [](const auto& test) {
                           return test.param == Scheme::kFive ? "Five" : "Six";
                         });
// ---- A real volume

struct BrainCase {
  Scheme scheme;
  std::uint64_t triangles;
  std::uint64_t vertices;
  std::uint64_t boundary_edges;
  std::uint64_t components;
  std::int64_t euler;
  double area_mm2;
  double volume_mm3;  // closed by the cone to sample (0, 0, 0)
};

class ExtractBrain : public testing::TestWithParam<BrainCase> {};

TEST_P(ExtractBrain, HasTheKnownNumbers) {
  const BrainCase& expected = GetParam();
  const auto volume = test::read_nifti_samples(test::kBrainFile);
  ASSERT_EQ(volume.dims.samples(), 181U * 217 * 181);
  const Mesh mesh =
      test::extracted(volume, {test::kBrainIso, expected.scheme, Interpolation::kLinear});
  EXPECT_EQ(mesh.triangles.size(), expected.triangles);
  EXPECT_EQ(mesh.positions.size(), expected.vertices);

  const Surface surface = test::surface_of(mesh);
  EXPECT_TRUE(test::is_sound(surface));
  EXPECT_TRUE(test::boundary_is_on_border(surface, volume.dims, volume.lattice().to_space));
  const test::TopologyFacts topology = test::topology_of(surface);
  EXPECT_EQ(topology.boundary_edges.size(), expected.boundary_edges);
  EXPECT_EQ(topology.components, expected.components);
  EXPECT_EQ(topology.euler, expected.euler);
  const test::ExtentFacts extent = test::extent_of(surface);
  // The known numbers are those of exact positions; many samples have the iso-value, and keeping
  // their vertices off them adds a little.
  EXPECT_NEAR(extent.area, expected.area_mm2, 0.5);
  EXPECT_NEAR(extent.volume, expected.volume_mm3, 0.5);
}

INSTANTIATE_TEST_SUITE_P(Schemes, ExtractBrain,
                         testing::Values(BrainCase{Scheme::kFive, 4062210, 2033703, 6964, 2270,
                                                   -884, 581722.65, 2794653.21},
                                         BrainCase{Scheme::kSix, 5091320, 2544488, 6994, 2189,
                                                   -4669, 593150.72, 2795793.94}),
                         [](const auto& test) {
                           return test.param.scheme == Scheme::kFive ? "Five" : "Six";
                         });

}  // namespace
}  // namespace isomesh::mesh
