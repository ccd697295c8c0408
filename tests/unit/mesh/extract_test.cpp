#include "server/mesh/extract.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <numbers>
#include <numeric>
#include <sstream>
#include <thread>
#include <type_traits>

#include <gtest/gtest.h>

#include "tests/support/kernels.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/nifti.h"
#include "tests/support/reference.h"
#include "tests/support/shapes.h"

namespace isomesh::mesh {
namespace {

using test::SampleVolume;
using test::Surface;

// The four ways to extract at one iso-value.
std::vector<ExtractOptions> all_options(double iso) {
  return {{iso, Scheme::kFive, Interpolation::kLinear},
          {iso, Scheme::kSix, Interpolation::kLinear},
          {iso, Scheme::kFive, Interpolation::kMidpoint},
          {iso, Scheme::kSix, Interpolation::kMidpoint}};
}

std::string describe(const Dims& dims, const ExtractOptions& options) {
  std::ostringstream text;
  text << dims.x << "x" << dims.y << "x" << dims.z << ", iso " << options.iso << ", scheme "
       << static_cast<int>(options.scheme) << ", " << to_string(options.interpolation);
  return text.str();
}

// Area and volume as the reference has them, but for the small way that vertices may be moved.
void expect_extent(const Surface& surface, const test::ReferenceMesh& reference,
                   const ExtractOptions& options) {
  const test::ExtentFacts expected =
      test::extent_of(reference.surface(), reference.to_space.origin);
  const test::ExtentFacts facts = test::extent_of(surface, reference.to_space.origin);
  double longest_edge = 0;
  double farthest = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const LatticeToSpace& map = reference.to_space;
    longest_edge +=
        std::abs(map.step_x[axis]) + std::abs(map.step_y[axis]) + std::abs(map.step_z[axis]);
    farthest += std::max(std::abs(expected.low[axis]), std::abs(expected.high[axis]));
  }
  const double margin =
      options.interpolation == Interpolation::kLinear ? test::kEndMargin * longest_edge : 0;
  const double moved = margin + 1e-6 * (longest_edge + farthest);
  const double area_change =
      moved * (expected.perimeter + moved * static_cast<double>(surface.triangles.size()));
  EXPECT_NEAR(facts.area, expected.area, area_change);
  // The cones from the border's edges to the apex count as well as the surface.
  EXPECT_NEAR(facts.volume, expected.volume, moved * expected.area + farthest * area_change);
}

template <class T>
void expect_reference_surface(const SampleVolume<T>& volume, const ExtractOptions& options) {
  SCOPED_TRACE(describe(volume.dims, options));
  const Lattice<T> lattice = volume.lattice();
  const test::ReferenceMesh reference = test::reference_surface(lattice, options);
  const SurfaceCount count = count_surface(lattice, options, {});
  EXPECT_EQ(count.vertices(), reference.vertices.size());
  EXPECT_EQ(count.triangles(), reference.triangles());
  Mesh mesh;
  extract_surface(lattice, options, count, {}, mesh);
  EXPECT_EQ(mesh.origin, lattice.to_space.origin);
  EXPECT_EQ(mesh.layer_vertices, count.layer_vertices);
  EXPECT_EQ(mesh.layer_triangles, count.layer_triangles);
  ASSERT_TRUE(test::matches(mesh, reference));
  const Surface surface = test::surface_of(mesh);
  EXPECT_TRUE(test::is_sound(surface));
  EXPECT_TRUE(test::boundary_is_on_border(surface, volume.dims, lattice.to_space));
  expect_extent(surface, reference, options);
}

// All four ways. Stops at the first that fails: one is enough to read.
template <class T>
void expect_reference_surfaces(const SampleVolume<T>& volume, double iso) {
  for (const ExtractOptions& options : all_options(iso)) {
    expect_reference_surface(volume, options);
    if (testing::Test::HasFailure()) return;
  }
}

template <class T>
void expect_empty(const SampleVolume<T>& volume, double iso) {
  for (const ExtractOptions& options : all_options(iso)) {
    SCOPED_TRACE(describe(volume.dims, options));
    const SurfaceCount count = count_surface(volume.lattice(), options, {});
    EXPECT_EQ(count.vertices(), 0U);
    EXPECT_EQ(count.triangles(), 0U);
    const Mesh mesh = test::extracted(volume, options);
    EXPECT_EQ(mesh.positions.size(), 0U);
    EXPECT_EQ(mesh.triangles.size(), 0U);
  }
}

// ---- Single cells

using CellCase = std::tuple<test::Parity, test::Surround>;
class SignPatterns : public testing::TestWithParam<CellCase> {};

TEST_P(SignPatterns, AreTheReferencesSurface) {
  const auto& [parity, surround] = GetParam();
  for (unsigned pattern = 0; pattern < 256 && !HasFailure(); ++pattern) {
    SCOPED_TRACE(pattern);
    expect_reference_surfaces(test::sign_pattern<std::uint8_t>(pattern, parity, surround),
                              test::kPatternIso);
  }
}

// The same in a cell whose neighbours in x belong to another word of 64 samples.
TEST_P(SignPatterns, AreTheReferencesSurfaceAcrossWords) {
  const auto& [parity, surround] = GetParam();
  for (unsigned pattern = 0; pattern < 256 && !HasFailure(); ++pattern) {
    SCOPED_TRACE(pattern);
    const auto cell = test::sign_pattern<float>(pattern, parity, surround);
    auto wide = test::constant<float>(cell.samples[0], {63 + cell.dims.x, 4, 4});
    for (std::uint32_t row = 0; row < 16; ++row) {
      // An even number of samples, so that the cell's parity stays.
      const std::uint32_t shift = cell.dims.x == 5 ? 60 : 62;
      std::copy_n(cell.samples.begin() + row * cell.dims.x, cell.dims.x,
                  wide.samples.begin() + row * wide.dims.x + shift);
    }
    for (const Scheme scheme : {Scheme::kFive, Scheme::kSix}) {
      expect_reference_surface(wide, {test::kPatternIso, scheme, Interpolation::kLinear});
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Cells, SignPatterns,
                         testing::Combine(testing::Values(test::Parity::kEven, test::Parity::kOdd),
                                          testing::Values(test::Surround::kOutside,
                                                          test::Surround::kInside)));

TEST(SignPattern, OfOneCellAloneIsTheReferencesSurface) {
  for (unsigned pattern = 0; pattern < 256 && !testing::Test::HasFailure(); ++pattern) {
    SCOPED_TRACE(pattern);
    SampleVolume<std::int16_t> volume = test::constant<std::int16_t>(-3, {2, 2, 2});
    for (unsigned corner = 0; corner < 8; ++corner) {
      if ((pattern >> corner & 1U) != 0) volume.samples[corner] = 5;
    }
    expect_reference_surfaces(volume, 0);
  }
}

// ---- Every type of sample

template <class T>
class ExtractFrom : public testing::Test {
 protected:
  static constexpr double kLow = std::numeric_limits<T>::lowest();
  static constexpr double kHigh = std::numeric_limits<T>::max();

  // Seven values around 3, or around 0 where there are negative ones.
  static std::vector<T> few_values() {
    std::vector<T> values(7);
    std::iota(values.begin(), values.end(), static_cast<T>(few_values_iso() - 3));
    return values;
  }
  static int few_values_iso() { return std::is_signed_v<T> ? 0 : 3; }

  static SampleVolume<T> wide_noise(const Dims& dims, std::uint64_t seed) {
    if (std::is_integral_v<T>) return test::noise_between<T>(kLow, kHigh, dims, seed);
    return test::noise_between<T>(-1000, 1000, dims, seed);
  }
  static double wide_noise_iso() {
    return std::is_integral_v<T> ? kLow * 0.6 + kHigh * 0.4 + 0.25 : -12.625;
  }
};

using SampleTypes = testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                                   std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(ExtractFrom, SampleTypes);

TYPED_TEST(ExtractFrom, NoiseOfEveryWidthIsTheReferencesSurface) {
  for (const std::uint32_t width : {2U, 3U, 5U, 31U, 62U, 63U, 64U, 65U, 66U, 127U, 128U, 129U}) {
    expect_reference_surfaces(this->wide_noise({width, 4, 3}, width), this->wide_noise_iso());
  }
}

TYPED_TEST(ExtractFrom, SamplesThatEqualTheIsoValueAreTheReferencesSurface) {
  for (const Dims dims : {Dims{63, 3, 4}, Dims{64, 4, 3}, Dims{65, 3, 3}, Dims{130, 3, 3}}) {
    const auto volume = test::noise(this->few_values(), dims, dims.x);
    expect_reference_surfaces(volume, this->few_values_iso());
    expect_reference_surfaces(volume, this->few_values_iso() - 0.5);
  }
}

TYPED_TEST(ExtractFrom, ThinVolumesAreTheReferencesSurface) {
  for (const Dims dims : {Dims{2, 9, 8}, Dims{9, 2, 8}, Dims{9, 8, 2}, Dims{2, 2, 2}, Dims{2, 2, 9},
                          Dims{2, 9, 2}, Dims{65, 2, 2}, Dims{128, 2, 2}, Dims{3, 3, 40}}) {
    expect_reference_surfaces(this->wide_noise(dims, 7), this->wide_noise_iso());
  }
}

TYPED_TEST(ExtractFrom, VolumesWithoutCellsHaveNoSurface) {
  for (const Dims dims :
       {Dims{1, 9, 8}, Dims{9, 1, 8}, Dims{9, 8, 1}, Dims{70, 1, 1}, Dims{1, 1, 1}, Dims{0, 0, 0},
        Dims{0, 5, 5}, Dims{5, 0, 5}, Dims{5, 5, 0}}) {
    expect_empty(this->wide_noise(dims, 8), this->wide_noise_iso());
  }
}

TYPED_TEST(ExtractFrom, AnIsoValueOutsideTheRangeHasNoSurface) {
  auto volume = test::noise(this->few_values(), {66, 5, 4}, 9);
  for (const double iso : {-1e300, -1e12, -3.5, 6.5, 300.0, 1e6, 1e12, 1e300}) {
    expect_empty(volume, iso);
  }
}

TYPED_TEST(ExtractFrom, IsoValuesAtTheEndsOfTheTypeAreTheReferencesSurface) {
  using T = TypeParam;
  const std::vector<T> values = {std::numeric_limits<T>::lowest(), std::numeric_limits<T>::max(),
                                 T{0}, T{1}};
  const auto volume = test::noise(values, {65, 4, 4}, 10);
  expect_reference_surfaces(volume, this->kHigh);
  expect_reference_surfaces(volume, 0.5);
  expect_reference_surfaces(volume, 1);
  expect_empty(volume, this->kLow);
  if (std::is_integral_v<T>) {
    expect_reference_surfaces(volume, this->kHigh - 0.5);
    expect_reference_surfaces(volume, this->kLow + 0.5);
    expect_empty(volume, this->kHigh + 0.5);
    expect_empty(volume, this->kLow - 0.5);
  }
}

TYPED_TEST(ExtractFrom, ACheckerboardIsTheReferencesSurface) {
  using T = TypeParam;
  expect_reference_surfaces(test::checkerboard<T>(T{1}, T{5}, {66, 5, 6}), 2.5);
  expect_reference_surfaces(test::checkerboard<T>(T{5}, T{1}, {66, 5, 6}), 5);
}

TYPED_TEST(ExtractFrom, AConstantVolumeHasNoSurface) {
  using T = TypeParam;
  const auto volume = test::constant<T>(T{42}, {65, 5, 6});
  expect_empty(volume, 42);
  expect_empty(volume, 41.5);
  expect_empty(volume, 42.5);
}

TYPED_TEST(ExtractFrom, SmoothShapesAreTheReferencesSurface) {
  const test::Field torus = test::torus({10, 9, 6}, 6, 2.5);
  const auto volume = test::sample<TypeParam>(test::scaled(torus, 9, 60), {21, 20, 13});
  expect_reference_surfaces(volume, 60);
  expect_reference_surfaces(volume, 61.5);
}

// ---- Values that floating point finds hard

TEST(ExtractFloats, ExtremesAreTheReferencesSurface) {
  using Limits = std::numeric_limits<float>;
  const std::vector<float> values = {Limits::lowest(),
                                     Limits::max(),
                                     -1e38F,
                                     1e38F,
                                     Limits::denorm_min(),
                                     -Limits::denorm_min(),
                                     1e-40F,
                                     -1e-40F,
                                     0.0F,
                                     -0.0F,
                                     1e-30F,
                                     -1e-30F,
                                     1.0F,
                                     -1.0F};
  const auto volume = test::noise(values, {65, 6, 6}, 11);
  for (const double iso : {0.0, 1e-40, -1e-40, 1e-30, 1e-300, 1.0, 0.1, 1e38, -1e38}) {
    expect_reference_surfaces(volume, iso);
  }
}

TEST(ExtractDoubles, LargeAndSmallValuesAreTheReferencesSurface) {
  const std::vector<double> values = {-1e300, 1e300, 1e-300, -0.0, 0.0, 1e-30, -1e-30, 1.0, -1.0};
  const auto volume = test::noise(values, {65, 6, 6}, 12);
  for (const double iso : {0.0, 1e-300, 1e-30, -1e-30, 1.0, 0.1, 1e300, -1e299}) {
    expect_reference_surfaces(volume, iso);
  }
}

TEST(ExtractDoubles, SubnormalValuesAreTheReferencesSurface) {
  const double least = std::numeric_limits<double>::denorm_min();
  const std::vector<double> values = {least, -least, 3 * least, 1e-310, -1e-310, 0.0, -0.0};
  const auto volume = test::noise(values, {65, 6, 6}, 24);
  for (const double iso : {0.0, least, 1e-310}) expect_reference_surfaces(volume, iso);
}

TEST(ExtractDoubles, DifferencesThatOverflowAreTheReferencesSurface) {
  using Limits = std::numeric_limits<double>;
  const std::vector<double> values = {Limits::lowest(), Limits::max(), -1e308, 1e308, 0.0, 1.0};
  const auto volume = test::noise(values, {65, 6, 6}, 22);
  for (const double iso : {0.0, 1.0, 1e308, -1e308}) {
    expect_reference_surfaces(volume, iso);
  }
}

TEST(ExtractFloats, AnIsoValueBetweenTwoFloatsDividesThem) {
  const float above = std::nextafter(1.0F, 2.0F);
  const auto volume = test::noise<float>({1.0F, above}, {65, 5, 5}, 13);
  expect_reference_surfaces(volume, 1 + 1e-9);
  expect_reference_surfaces(volume, above);
  expect_empty(volume, 1);
  expect_empty(volume, above + 1e-9);
}

TEST(ExtractFloats, ValuesNextToTheIsoValueKeepVerticesOffTheSamples) {
  const std::vector<float> values = {1e-30F, -1e-30F, 1.0F, -1.0F, 0.0F};
  expect_reference_surfaces(test::noise(values, {65, 6, 6}, 14), 0);
}

TEST(ExtractUint32, DistinguishesLargeNeighbours) {
  const std::vector<std::uint32_t> values = {4294967290U, 4294967291U, 4294967293U, 4294967295U};
  const auto volume = test::noise(values, {65, 5, 5}, 15);
  expect_reference_surfaces(volume, 4294967292.25);
  expect_reference_surfaces(volume, 4294967293.0);
}

TEST(ExtractInt32, DistinguishesLargeNeighbours) {
  const std::vector<std::int32_t> values = {-2147483648, -2147483647, -2147483645, -2147483643};
  const auto volume = test::noise(values, {65, 5, 5}, 16);
  expect_reference_surfaces(volume, -2147483645.75);
  expect_reference_surfaces(volume, -2147483645.0);
}

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

// ---- Layers, threads, memory, cancellation

constexpr Dims kManyLayers = {21, 17, 150};

SampleVolume<std::uint8_t> many_layers() {
  return test::noise<std::uint8_t>({0, 40, 80, 120, 160}, kManyLayers, 19);
}

TEST(ExtractLayers, TrianglesNameVerticesOfTheirLayerAndTheNext) {
  for (const ExtractOptions& options : all_options(80)) {
    const Mesh mesh = test::extracted(many_layers(), options);
    ASSERT_EQ(mesh.layers(), kManyLayers.z);
    for (std::size_t k = 0; k + 1 < mesh.layers(); ++k) {
      for (std::size_t t = mesh.layer_triangles[k]; t < mesh.layer_triangles[k + 1]; ++t) {
        for (const std::uint32_t v : mesh.triangles[t]) {
          ASSERT_GE(v, mesh.layer_vertices[k]);
          ASSERT_LT(v, mesh.layer_vertices[k + 2]);
        }
      }
    }
    EXPECT_EQ(mesh.layer_triangles[kManyLayers.z - 1], mesh.triangles.size());
  }
}

TEST(ExtractLayers, VerticesLieBetweenTheirPlaneAndTheNext) {
  const Mesh mesh = test::extracted(many_layers(), {80, Scheme::kSix, Interpolation::kLinear});
  for (std::size_t k = 0; k < mesh.layers(); ++k) {
    for (std::size_t v = mesh.layer_vertices[k]; v < mesh.layer_vertices[k + 1]; ++v) {
      ASSERT_GE(mesh.positions[v][2], static_cast<float>(k));
      ASSERT_LT(mesh.positions[v][2], static_cast<float>(k + 1));
    }
  }
}

TEST(ExtractThreads, GiveTheSameBytes) {
  const auto volume = many_layers();
  for (const ExtractOptions& options : all_options(80)) {
    SCOPED_TRACE(describe(volume.dims, options));
    Mesh single;
    {
      const test::ThreadCount one(1);
      test::extract_into(single, volume, options);
    }
    EXPECT_TRUE(test::matches(single, test::reference_surface(volume.lattice(), options)));
    for (const int threads : {2, 3, 16}) {
      SCOPED_TRACE(threads);
      const test::ThreadCount several(threads);
      EXPECT_TRUE(test::same_bytes(single, test::extracted(volume, options)));
    }
  }
}

TEST(ExtractThreads, MayExtractSeveralMeshesAtOnce) {
  const auto volume = many_layers();
  const std::vector<ExtractOptions> options = all_options(80);
  std::vector<Mesh> together(options.size());
  {
    std::vector<std::jthread> jobs;
    for (std::size_t n = 0; n < options.size(); ++n) {
      jobs.emplace_back([&, n] { test::extract_into(together[n], volume, options[n]); });
    }
  }
  for (std::size_t n = 0; n < options.size(); ++n) {
    EXPECT_TRUE(test::same_bytes(together[n], test::extracted(volume, options[n])));
  }
}

TEST(ExtractMemory, OfALargerMeshIsReusedWithoutATrace) {
  const auto large = many_layers();
  const auto small = test::noise<std::int16_t>({-1, 0, 1, 2}, {17, 9, 12}, 20);
  Mesh mesh;
  test::extract_into(mesh, large, {80, Scheme::kSix, Interpolation::kLinear});
  const Vec3* const positions = mesh.positions.data();
  const Triangle* const triangles = mesh.triangles.data();
  for (const ExtractOptions& options : all_options(0.5)) {
    test::extract_into(mesh, small, options);
    EXPECT_TRUE(test::same_bytes(mesh, test::extracted(small, options)));
    EXPECT_EQ(mesh.positions.data(), positions);
    EXPECT_EQ(mesh.triangles.data(), triangles);
  }
  test::extract_into(mesh, small, {1e9, Scheme::kSix, Interpolation::kLinear});
  EXPECT_EQ(mesh.positions.size(), 0U);
  EXPECT_EQ(mesh.triangles.size(), 0U);
}

TEST(ExtractMemory, IsNotTakenForMoreVerticesThanIndicesCanName) {
  const auto volume = test::checkerboard<std::uint8_t>(0, 9, {4, 4, 4});
  const ExtractOptions options = {5, Scheme::kSix, Interpolation::kLinear};
  SurfaceCount count = count_surface(volume.lattice(), options, {});
  count.layer_vertices.back() = std::uint64_t{1} << 33;
  Mesh mesh;
  try {
    extract_surface(volume.lattice(), options, count, {}, mesh);
    FAIL() << "it was not refused";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kTooLarge);
  }
  EXPECT_EQ(mesh.positions.capacity_bytes(), 0U);
  EXPECT_EQ(mesh.triangles.capacity_bytes(), 0U);
}

// Runs `work` and tells whether it ended with Error kCancelled.
template <class Work>
bool is_cancelled(const Work& work) {
  try {
    work();
    return false;
  } catch (const Error& error) {
    return error.code() == ErrorCode::kCancelled;
  }
}

TEST(ExtractCancellation, BeforeTheStartEndsBothPasses) {
  const auto volume = many_layers();
  std::stop_source source;
  source.request_stop();
  const Context stopped{source.get_token(), {}};
  for (const ExtractOptions& options : all_options(80)) {
    const SurfaceCount count = count_surface(volume.lattice(), options, {});
    EXPECT_TRUE(is_cancelled([&] { count_surface(volume.lattice(), options, stopped); }));
    Mesh mesh;
    EXPECT_TRUE(
        is_cancelled([&] { extract_surface(volume.lattice(), options, count, stopped, mesh); }));
  }
}

TEST(ExtractCancellation, OnTheWayEndsBothPasses) {
  const auto volume = test::noise<std::uint8_t>({0, 0, 0, 0, 9}, {33, 17, 1200}, 21);
  const ExtractOptions options = {5, Scheme::kSix, Interpolation::kLinear};
  const SurfaceCount count = count_surface(volume.lattice(), options, {});
  for (const int threads : {1, 2}) {
    const test::ThreadCount limit(threads);
    std::stop_source counting;
    const Context stops_counting{counting.get_token(), [&](double) { counting.request_stop(); }};
    EXPECT_TRUE(is_cancelled([&] { count_surface(volume.lattice(), options, stops_counting); }));

    std::stop_source writing;
    const Context stops_writing{writing.get_token(), [&](double) { writing.request_stop(); }};
    Mesh mesh;
    EXPECT_TRUE(is_cancelled(
        [&] { extract_surface(volume.lattice(), options, count, stops_writing, mesh); }));
    // What a cancelled job leaves behind does no harm to the next.
    extract_surface(volume.lattice(), options, count, {}, mesh);
    EXPECT_TRUE(test::same_bytes(mesh, test::extracted(volume, options)));
  }
}

TEST(ExtractProgress, RisesToOne) {
  const auto volume = many_layers();
  const test::ThreadCount one(1);
  std::vector<double> reports;
  const Context context{{}, [&](double share) { reports.push_back(share); }};
  const auto expect_rise = [&] {
    ASSERT_FALSE(reports.empty());
    EXPECT_GE(reports.front(), 0);
    EXPECT_TRUE(std::is_sorted(reports.begin(), reports.end()));
    EXPECT_DOUBLE_EQ(reports.back(), 1);
    reports.clear();
  };
  const ExtractOptions options = {80, Scheme::kFive, Interpolation::kLinear};
  const SurfaceCount count = count_surface(volume.lattice(), options, context);
  expect_rise();
  Mesh mesh;
  extract_surface(volume.lattice(), options, count, context, mesh);
  expect_rise();
}

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
