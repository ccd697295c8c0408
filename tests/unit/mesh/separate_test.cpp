#include "server/mesh/labels/separate.h"

#include <algorithm>
#include <thread>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/any_threads.h"
#include "tests/support/errors.h"
#include "tests/support/step.h"
#include "tests/unit/mesh/separated.h"

namespace isomesh::mesh {
namespace {

using test::SampleVolume;

template <class T>
void expect_reference(const SampleVolume<T>& volume, const SeparateOptions& options) {
  SCOPED_TRACE(describe(volume.dims, options));
  const Lattice<T> lattice = volume.lattice();
  const test::LabelReference reference = test::label_reference(lattice, options);
  const SurfaceCount count = count_walls(lattice, options, {});
  EXPECT_EQ(count.vertices(), reference.vertices.size());
  EXPECT_EQ(count.triangles(), reference.triangles());
  const SeparatingSurface surface = separated(volume, options);
  EXPECT_EQ(surface.mesh.origin, lattice.to_space.origin);
  EXPECT_EQ(surface.mesh.layer_vertices, count.layer_vertices);
  EXPECT_EQ(surface.labels, options.labels);
  ASSERT_TRUE(test::matches(surface, reference));
}

template <class T>
void expect_references(const SampleVolume<T>& volume, const std::vector<std::int64_t>& labels) {
  for (const SeparateOptions& options : all_separations(labels)) {
    expect_reference(volume, options);
    if (testing::Test::HasFailure()) return;
  }
}

// ---- The brute-force reference

class SeparateNoise : public testing::TestWithParam<std::size_t> {};

TEST_P(SeparateNoise, IsTheReferencesSurface) {
  const std::size_t count = GetParam();
  for (const Dims dims : {Dims{2, 2, 2}, Dims{2, 7, 3}, Dims{9, 8, 7}, Dims{66, 4, 5}}) {
    expect_references(label_noise(count, dims, 40 + count),
                      consecutive<std::int64_t>(1, count - 1));
  }
}

TEST_P(SeparateNoise, OfSparseLabelsIsTheReferencesSurface) {
  const std::size_t count = GetParam();
  auto volume = label_noise(count, {70, 9, 8}, 80 + count);
  const auto mostly = test::noise<std::uint8_t>({0, 1, 1, 1, 1, 1, 1, 1}, volume.dims, 7);
  for (std::size_t i = 0; i < volume.samples.size(); ++i) {
    if (mostly.samples[i] != 0) volume.samples[i] = 1;
  }
  expect_references(volume, consecutive<std::int64_t>(1, count - 1));
}

INSTANTIATE_TEST_SUITE_P(Labels, SeparateNoise, testing::Range<std::size_t>(2, 10));

class SeparateGeometry : public testing::TestWithParam<test::NamedGeometry> {};

TEST_P(SeparateGeometry, IsTheReferencesSurface) {
  expect_references(label_noise(5, {7, 6, 8}, 50, GetParam().geometry), {1, 2, 3, 4});
}

INSTANTIATE_TEST_SUITE_P(Geometries, SeparateGeometry, testing::ValuesIn(test::all_geometries()),
                         [](const auto& geometry) { return geometry.param.name; });

// Every cell has eight labels, and every tetrahedron four.
TEST(Separate, WhereEveryTetrahedronHasFourLabelsIsTheReferencesSurface) {
  auto volume = test::constant<std::uint8_t>(0, {7, 6, 5});
  for (std::uint32_t k = 0; k < 5; ++k) {
    for (std::uint32_t j = 0; j < 6; ++j) {
      for (std::uint32_t i = 0; i < 7; ++i) {
        volume.at(i, j, k) = static_cast<std::uint8_t>(i % 2 + 2 * (j % 2) + 4 * (k % 2));
      }
    }
  }
  expect_references(volume, consecutive<std::int64_t>(1, 7));
  const std::uint64_t cells = 6 * 5 * 4;
  EXPECT_EQ(separated(volume, {consecutive<std::int64_t>(1, 7)}).mesh.triangles.size(),
            cells * 6 * 12);
  EXPECT_EQ(
      separated(volume, {consecutive<std::int64_t>(1, 7), Scheme::kFive}).mesh.triangles.size(),
      cells * 5 * 12);
}

// One cell at a time, of either parity, between its own labels and others.
TEST(Separate, OfSingleCellsIsTheReferencesSurface) {
  for (std::uint64_t seed = 0; seed < 150 && !testing::Test::HasFailure(); seed += test::kStep) {
    SCOPED_TRACE(seed);
    auto volume = test::constant<std::uint8_t>(static_cast<std::uint8_t>(seed % 3), {4, 4, 4});
    const auto corners = label_noise(2 + seed % 4, {2, 2, 2}, seed);
    const std::uint64_t at = seed % 2;
    for (std::size_t c = 0; c < 8; ++c) {
      volume.at(at + (c & 1), 1 + (c >> 1 & 1), 1 + (c >> 2)) = corners.samples[c];
    }
    expect_references(volume, consecutive<std::int64_t>(1, 5));
  }
}

template <class T>
class SeparateTypes : public testing::Test {};
TYPED_TEST_SUITE(SeparateTypes, LabelTypes);

TYPED_TEST(SeparateTypes, HaveTheirWholeRange) {
  using T = TypeParam;
  constexpr T kLow = std::numeric_limits<T>::min();
  constexpr T kHigh = std::numeric_limits<T>::max();
  const T background = kLow == 0 ? 7 : 0;
  const auto volume = test::noise<T>({kLow, background, 100, kHigh}, {9, 8, 7}, 61);
  expect_references(volume, {kLow, 100, kHigh});
  // Labels that no sample can have change nothing.
  SeparateOptions options = {{kLow, 100, kHigh}};
  const SeparatingSurface surface = separated(volume, options);
  options.labels.push_back(std::int64_t{1} << 40);
  EXPECT_TRUE(same_bytes(separated(volume, options), surface));
}

TEST(Separate, HasAsManyLabelsAsThereMayBe) {
  auto volume = test::constant<std::uint16_t>(0, {64, 64, 16});
  for (std::size_t i = 0; i < volume.samples.size(); ++i) {
    volume.samples[i] = static_cast<std::uint16_t>(i);
  }
  const SeparateOptions options = {consecutive<std::int64_t>(1, kMostLabels)};
  const SeparatingSurface surface = separated(volume, options);
  EXPECT_EQ(surface.mesh.triangles.size(), 63U * 63 * 15 * 72);
  EXPECT_EQ(surface.labels.size(), kMostLabels);
  EXPECT_EQ(std::ranges::max(surface.sides, {}, &WallSides::back).back, kMostLabels);
}

// ---- An iso-value is the case of two labels

TEST(SeparateTwoLabels, IsTheIsosurfaceHalfWay) {
  for (const Scheme scheme : {Scheme::kFive, Scheme::kSix}) {
    for (const auto& [name, geometry] : test::all_geometries()) {
      SCOPED_TRACE(name);
      const auto volume = test::noise<std::int16_t>({0, 6}, {70, 17, 15}, 62, geometry);
      const Mesh mesh = test::extracted(volume, {3, scheme, Interpolation::kMidpoint});
      const SeparatingSurface surface = separated(volume, {{6}, scheme});
      EXPECT_TRUE(test::same_bytes(surface.mesh, mesh));
      for (const WallSides& sides : surface.sides) ASSERT_EQ(sides, (WallSides{0, 1}));
    }
  }
}

TEST(SeparateTwoLabels, WithoutABackgroundTheSmallerIsInFront) {
  const auto volume = test::noise<std::uint8_t>({3, 6}, {20, 17, 15}, 63);
  const SeparatingSurface surface = separated(volume, {{3, 6}});
  EXPECT_TRUE(test::same_bytes(
      surface.mesh, test::extracted(volume, {5, Scheme::kSix, Interpolation::kMidpoint})));
  for (const WallSides& sides : surface.sides) ASSERT_EQ(sides, (WallSides{1, 2}));
}

TEST(SeparateTwoLabels, ClosedHasTheIsosurfacesTriangles) {
  for (const Scheme scheme : {Scheme::kFive, Scheme::kSix}) {
    const auto volume = test::noise<std::int16_t>({0, 6}, {21, 17, 15}, 64);
    const Mesh mesh = test::extracted(volume, {3, scheme, Interpolation::kMidpoint, true});
    const SeparatingSurface surface = separated(volume, {{6}, scheme, true});
    EXPECT_TRUE(std::ranges::equal(surface.mesh.triangles, mesh.triangles));
    EXPECT_EQ(surface.mesh.on_border, mesh.on_border);
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
      if (mesh.is_on_border(v)) continue;
      ASSERT_EQ(surface.mesh.positions[v], mesh.positions[v]);
    }
  }
}

// ---- What is no label

TEST(SeparateUnlisted, AreBackground) {
  const auto volume = label_noise(9, {23, 12, 11}, 65);
  auto listed = volume;
  for (std::uint8_t& sample : listed.samples) {
    if (sample != 2 && sample != 5) sample = 0;
  }
  for (const SeparateOptions& options : all_separations({2, 5})) {
    EXPECT_TRUE(same_bytes(separated(volume, options), separated(listed, options)));
  }
}

TEST(SeparateNothing, HasNoWalls) {
  const std::vector<std::int64_t> labels = {4};
  const auto expect_empty = [](const SampleVolume<std::uint8_t>& volume,
                               const SeparateOptions& options) {
    SCOPED_TRACE(describe(volume.dims, options));
    EXPECT_EQ(count_walls(volume.lattice(), options, {}).triangles(), 0U);
    const SeparatingSurface surface = separated(volume, options);
    EXPECT_EQ(surface.mesh.positions.size(), 0U);
    EXPECT_EQ(surface.sides.size(), 0U);
  };
  expect_empty(test::constant<std::uint8_t>(4, {9, 8, 7}), {labels});
  expect_empty(test::constant<std::uint8_t>(0, {9, 8, 7}), {labels, Scheme::kSix, true});
  expect_empty(test::constant<std::uint8_t>(3, {9, 8, 7}), {labels, Scheme::kSix, true});
  expect_empty(test::constant<std::uint8_t>(4, {9, 8, 7}), {{}, Scheme::kSix, true});
  expect_empty(label_noise(9, {1, 8, 7}, 66), {labels, Scheme::kSix, true});
  expect_empty(label_noise(9, {0, 0, 0}, 66), {labels});
}

// ---- Threads, memory, cancellation

SampleVolume<std::uint8_t> many_layers() { return label_cells(12, {70, 21, 90}, 18, 67); }

TEST(SeparateThreads, GiveTheSameBytes) {
  const auto volume = many_layers();
  for (const SeparateOptions& options : all_separations(consecutive<std::int64_t>(1, 12))) {
    SCOPED_TRACE(describe(volume.dims, options));
    test::expect_same_on_any_threads([&] { return separated(volume, options); }, test::kSameBytes);
  }
}

TEST(SeparateMemory, OfALargerSurfaceIsReusedWithoutATrace) {
  const auto small = label_noise(4, {11, 9, 12}, 68);
  SeparatingSurface surface = separated(many_layers(), {consecutive<std::int64_t>(1, 12)});
  const Vec3* const positions = surface.mesh.positions.data();
  for (const SeparateOptions& options : all_separations({1, 2, 3})) {
    separate_into(surface, small, options);
    EXPECT_TRUE(same_bytes(surface, separated(small, options)));
    EXPECT_EQ(surface.mesh.positions.data(), positions);
  }
  // A mesh that has held walls holds an iso-surface afterwards.
  test::extract_into(surface.mesh, small, {2});
  EXPECT_TRUE(surface.mesh.on_line.empty());
}

TEST(SeparateMemory, IsNotTakenForMoreVerticesThanIndicesCanName) {
  const auto volume = label_noise(4, {4, 4, 4}, 69);
  const SeparateOptions options = {{1, 2, 3}};
  SurfaceCount count = count_walls(volume.lattice(), options, {});
  count.layer_vertices.back() = std::uint64_t{1} << 33;
  SeparatingSurface surface;
  EXPECT_EQ(
      test::code_thrown_by([&] { extract_walls(volume.lattice(), options, count, {}, surface); }),
      ErrorCode::kTooLarge);
  EXPECT_EQ(surface.mesh.positions.capacity_bytes(), 0U);
  EXPECT_EQ(surface.sides.capacity_bytes(), 0U);
}

TEST(SeparateCancellation, EndsBothPasses) {
  const auto volume = many_layers();
  const SeparateOptions options = {consecutive<std::int64_t>(1, 12)};
  const SurfaceCount count = count_walls(volume.lattice(), options, {});
  const test::ThreadCount one(1);
  std::stop_source counting;
  const Context stops_counting{counting.get_token(), [&](double) { counting.request_stop(); }};
  EXPECT_EQ(test::code_thrown_by([&] { count_walls(volume.lattice(), options, stops_counting); }),
            ErrorCode::kCancelled);
  std::stop_source writing;
  const Context stops_writing{writing.get_token(), [&](double) { writing.request_stop(); }};
  SeparatingSurface surface;
  EXPECT_EQ(test::code_thrown_by(
                [&] { extract_walls(volume.lattice(), options, count, stops_writing, surface); }),
            ErrorCode::kCancelled);
  extract_walls(volume.lattice(), options, count, {}, surface);
  EXPECT_TRUE(same_bytes(surface, separated(volume, options)));
}

}  // namespace
}  // namespace isomesh::mesh
