#include "server/mesh/extract/extract.h"

#include <algorithm>
#include <mutex>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/extract/windows.h"
#include "tests/support/any_threads.h"
#include "tests/support/errors.h"
#include "tests/unit/mesh/reference_surface.h"

namespace isomesh::mesh {
namespace {

using test::SampleVolume;

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
    const Mesh single = test::expect_same_on_any_threads(
        [&] { return test::extracted(volume, options); }, test::kSameBytes);
    if (options.scheme == Scheme::kSix) {
      EXPECT_TRUE(
          test::matches(single, test::scalar_surface(test::in_doubles(volume).lattice(), options)));
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

TEST(ExtractCancellation, BeforeTheStartEndsBothPasses) {
  const auto volume = many_layers();
  std::stop_source source;
  source.request_stop();
  const Context stopped{source.get_token(), {}};
  for (const ExtractOptions& options : all_options(80)) {
    const auto lattice = volume.lattice();
    SurfaceWindows windows(lattice, options, {});
    EXPECT_EQ(test::code_thrown_by([&] { count_surface(volume.lattice(), options, stopped); }),
              ErrorCode::kCancelled);
    Mesh mesh;
    EXPECT_EQ(test::code_thrown_by([&] { windows.write_whole(stopped, mesh); }),
              ErrorCode::kCancelled);
  }
}

TEST(ExtractCancellation, OnTheWayEndsBothPasses) {
  const auto volume = test::noise<std::uint8_t>({0, 0, 0, 0, 9}, {33, 17, 1200}, 21);
  const ExtractOptions options = {5, Scheme::kSix, Interpolation::kLinear};
  const auto lattice = volume.lattice();
  SurfaceWindows windows(lattice, options, {});
  for (const int threads : {1, 2}) {
    const test::ThreadCount limit(threads);
    std::stop_source counting;
    const Context stops_counting{counting.get_token(), [&](double) { counting.request_stop(); }};
    EXPECT_EQ(
        test::code_thrown_by([&] { count_surface(volume.lattice(), options, stops_counting); }),
        ErrorCode::kCancelled);

    std::stop_source writing;
    const Context stops_writing{writing.get_token(), [&](double) { writing.request_stop(); }};
    Mesh mesh;
    EXPECT_EQ(test::code_thrown_by([&] { windows.write_whole(stops_writing, mesh); }),
              ErrorCode::kCancelled);
    // A mesh left by a cancelled job does not affect the next extraction.
    windows.write_whole({}, mesh);
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
  const auto lattice = volume.lattice();
  SurfaceWindows windows(lattice, options, context);
  expect_rise();
  Mesh mesh;
  windows.write_whole(context, mesh);
  expect_rise();
}

}  // namespace
}  // namespace isomesh::mesh
