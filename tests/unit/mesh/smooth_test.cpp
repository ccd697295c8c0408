#include "server/mesh/smooth.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/kernels.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"

namespace isomesh::mesh {
namespace {

using test::Surface;

struct NamedMesh {
  std::string name;
  Mesh mesh;
};

Mesh closed_ball() {
  return test::extracted(test::sample<float>(test::sphere({10.2, 9.8, 10.4}, 7.3), {21, 21, 22}),
                         {});
}

Mesh open_plane() {
  const test::Field field = test::plane({2.0 / 7, 3.0 / 7, 6.0 / 7}, 9);
  return test::extracted(test::sample<float>(field, {20, 18, 16}),
                         {0, Scheme::kFive, Interpolation::kMidpoint});
}

// Many components, handles and boundary loops, and vertices of every valence.
Mesh open_noise() {
  return test::extracted(test::noise<std::uint8_t>({0, 1, 2, 3}, {40, 19, 70}, 31),
                         {2, Scheme::kSix, Interpolation::kLinear});
}

Mesh oblique_noise() {
  const auto volume =
      test::noise<std::int16_t>({-5, 1, 4}, {18, 17, 16}, 32, test::oblique_left_handed_geometry());
  return test::extracted(volume, {0, Scheme::kFive, Interpolation::kLinear});
}

std::vector<NamedMesh> meshes() {
  std::vector<NamedMesh> result;
  result.push_back({"closed ball", closed_ball()});
  result.push_back({"open plane", open_plane()});
  result.push_back({"open noise", open_noise()});
  result.push_back({"oblique noise", oblique_noise()});
  return result;
}

Mesh copy_of(const Mesh& mesh) {
  Mesh copy;
  copy.origin = mesh.origin;
  copy.positions.resize_for_overwrite(mesh.positions.size());
  std::copy(mesh.positions.begin(), mesh.positions.end(), copy.positions.begin());
  copy.triangles.resize_for_overwrite(mesh.triangles.size());
  std::copy(mesh.triangles.begin(), mesh.triangles.end(), copy.triangles.begin());
  copy.layer_vertices = mesh.layer_vertices;
  copy.layer_triangles = mesh.layer_triangles;
  return copy;
}

Mesh smoothed(const Mesh& mesh, const SmoothOptions& options) {
  Mesh result = copy_of(mesh);
  Connectivity connectivity;
  build_connectivity(result, {}, connectivity);
  Buffer<Vec3> scratch;
  smooth_laplacian(connectivity, options, {}, result, scratch);
  return result;
}

// Farthest that two surfaces' points lie apart.
double largest_distance(const Surface& a, const Surface& b) {
  double largest = 0;
  for (std::size_t v = 0; v < a.points.size(); ++v) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      largest = std::max(largest, std::abs(a.points[v][axis] - b.points[v][axis]));
    }
  }
  return largest;
}

// Sorted, so that lists in another order compare equal.
std::vector<std::uint32_t> neighbors_of(const Connectivity& connectivity, std::uint32_t vertex) {
  std::vector<std::uint32_t> list(
      connectivity.neighbors.begin() + connectivity.offsets[vertex],
      connectivity.neighbors.begin() + connectivity.offsets[vertex + 1]);
  std::sort(list.begin(), list.end());
  return list;
}

void expect_neighbors(const Mesh& mesh, const Connectivity& connectivity) {
  ASSERT_EQ(connectivity.offsets.size(), mesh.positions.size() + 1);
  EXPECT_EQ(connectivity.offsets[0], 0U);
  EXPECT_EQ(connectivity.offsets[mesh.positions.size()], connectivity.neighbors.size());
  const auto expected = test::free_neighbors(test::surface_of(mesh));
  for (std::uint32_t v = 0; v < expected.size(); ++v) {
    ASSERT_EQ(neighbors_of(connectivity, v), expected[v]) << "of vertex " << v;
  }
}

bool same_lists(const Connectivity& a, const Connectivity& b) {
  return std::equal(a.offsets.begin(), a.offsets.end(), b.offsets.begin(), b.offsets.end()) &&
         std::equal(a.neighbors.begin(), a.neighbors.end(), b.neighbors.begin(), b.neighbors.end());
}

template <class Work>
bool is_cancelled(const Work& work) {
  try {
    work();
    return false;
  } catch (const Error& error) {
    return error.code() == ErrorCode::kCancelled;
  }
}

TEST(BuildConnectivity, ListsTheNeighboursOfFreeVertices) {
  for (const auto& [name, mesh] : meshes()) {
    SCOPED_TRACE(name);
    Connectivity connectivity;
    build_connectivity(mesh, {}, connectivity);
    expect_neighbors(mesh, connectivity);
  }
}

TEST(BuildConnectivity, GivesAnEmptyMeshNoLists) {
  Connectivity connectivity;
  build_connectivity(Mesh{}, {}, connectivity);
  ASSERT_EQ(connectivity.offsets.size(), 1U);
  EXPECT_EQ(connectivity.offsets[0], 0U);
  EXPECT_EQ(connectivity.neighbors.size(), 0U);
}

TEST(BuildConnectivity, ReusesItsMemoryWithoutATrace) {
  Connectivity connectivity;
  build_connectivity(open_noise(), {}, connectivity);
  const std::uint32_t* const offsets = connectivity.offsets.data();
  const Mesh small = open_plane();
  build_connectivity(small, {}, connectivity);
  expect_neighbors(small, connectivity);
  EXPECT_EQ(connectivity.offsets.data(), offsets);
}

TEST(BuildConnectivity, IsTheSameOnAnyNumberOfThreads) {
  const Mesh mesh = open_noise();
  Connectivity single;
  {
    const test::ThreadCount one(1);
    build_connectivity(mesh, {}, single);
  }
  for (const int threads : {2, 3, 16}) {
    const test::ThreadCount several(threads);
    Connectivity connectivity;
    build_connectivity(mesh, {}, connectivity);
    EXPECT_TRUE(same_lists(connectivity, single)) << threads << " threads";
  }
}

class SmoothLaplacian : public testing::TestWithParam<SmoothOptions> {};

TEST_P(SmoothLaplacian, MovesVerticesAsTheNaiveWayDoes) {
  const auto& [passes, lambda] = GetParam();
  for (const auto& [name, mesh] : meshes()) {
    SCOPED_TRACE(name);
    const Surface result = test::surface_of(smoothed(mesh, GetParam()));
    const Surface expected = test::naively_smoothed(test::surface_of(mesh), passes, lambda);
    EXPECT_EQ(result.triangles, expected.triangles);
    // A few roundings of a coordinate of about a hundred for each pass.
    EXPECT_LT(largest_distance(result, expected), 3e-5 * (1 + passes));
  }
}

TEST_P(SmoothLaplacian, LeavesBoundaryVerticesWhereTheyAre) {
  for (const auto& [name, mesh] : meshes()) {
    SCOPED_TRACE(name);
    const Mesh result = smoothed(mesh, GetParam());
    for (const auto& [from, to] : test::topology_of(test::surface_of(mesh)).boundary_edges) {
      ASSERT_EQ(result.positions[from], mesh.positions[from]);
      ASSERT_EQ(result.positions[to], mesh.positions[to]);
    }
  }
}

TEST_P(SmoothLaplacian, GivesTheSameBytesOnAnyNumberOfThreads) {
  const Mesh mesh = open_noise();
  Mesh single;
  {
    const test::ThreadCount one(1);
    single = smoothed(mesh, GetParam());
  }
  for (const int threads : {2, 3, 16}) {
    SCOPED_TRACE(threads);
    const test::ThreadCount several(threads);
    EXPECT_TRUE(test::same_bytes(smoothed(mesh, GetParam()), single));
  }
}

INSTANTIATE_TEST_SUITE_P(Passes, SmoothLaplacian,
                         testing::Values(SmoothOptions{1, 1}, SmoothOptions{2, 1},
                                         SmoothOptions{5, 1}, SmoothOptions{1, 0.3},
                                         SmoothOptions{4, 0.5}, SmoothOptions{20, 0.9}));

TEST(SmoothNothing, WithNoPassesLeavesTheBytes) {
  for (const auto& [name, mesh] : meshes()) {
    SCOPED_TRACE(name);
    EXPECT_TRUE(test::same_bytes(smoothed(mesh, {0, 1}), mesh));
  }
}

TEST(SmoothNothing, LeavesAnEmptyMeshEmpty) {
  EXPECT_EQ(smoothed(Mesh{}, {5, 1}).positions.size(), 0U);
}

TEST(SmoothNothing, MovesNoVertexOfAMeshThatIsAllBoundary) {
  // The five-way split has no edge inside a cell.
  const Mesh mesh =
      test::extracted(test::checkerboard<std::uint8_t>(0, 9, {2, 2, 2}), {5, Scheme::kFive});
  ASSERT_EQ(mesh.positions.size(), 12U);
  EXPECT_TRUE(test::same_bytes(smoothed(mesh, {3, 1}), mesh));
}

// The expected positions are written out by hand: a pyramid over a square whose border is fixed.
TEST(SmoothByHand, MovesTheOneFreeVertexByItsShare) {
  Mesh mesh;
  mesh.positions.resize_for_overwrite(5);
  const std::vector<Vec3> corners = {{0, 0, 0}, {4, 0, 0}, {4, 4, 0}, {0, 4, 0}, {1, 1, 8}};
  std::copy(corners.begin(), corners.end(), mesh.positions.begin());
  const std::vector<Triangle> sides = {{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}};
  mesh.triangles.resize_for_overwrite(sides.size());
  std::copy(sides.begin(), sides.end(), mesh.triangles.begin());
  mesh.layer_vertices = {0, 5};
  mesh.layer_triangles = {0, 4};

  const Mesh whole = smoothed(mesh, {1, 1});
  EXPECT_EQ(whole.positions[4], (Vec3{2, 2, 0}));
  const Mesh half = smoothed(mesh, {1, 0.5});
  EXPECT_EQ(half.positions[4], (Vec3{1.5F, 1.5F, 4}));
  const Mesh twice = smoothed(mesh, {2, 0.5});
  EXPECT_EQ(twice.positions[4], (Vec3{1.75F, 1.75F, 2}));
  for (std::size_t v = 0; v < 4; ++v) EXPECT_EQ(twice.positions[v], corners[v]);
}

TEST(SmoothShape, ShrinksABallAndItsSurface) {
  const Mesh mesh = closed_ball();
  const auto before = test::extent_of(test::surface_of(mesh));
  const auto after = test::extent_of(test::surface_of(smoothed(mesh, {10, 1})));
  EXPECT_LT(after.area, before.area);
  EXPECT_LT(after.volume, before.volume);
  EXPECT_GT(after.volume, 0.8 * before.volume);
}

TEST(SmoothScratch, OfALargerMeshIsReusedWithoutATrace) {
  Buffer<Vec3> scratch;
  Connectivity connectivity;
  Mesh large = open_noise();
  build_connectivity(large, {}, connectivity);
  smooth_laplacian(connectivity, {3, 1}, {}, large, scratch);
  Mesh small = open_plane();
  build_connectivity(small, {}, connectivity);
  smooth_laplacian(connectivity, {3, 1}, {}, small, scratch);
  EXPECT_TRUE(test::same_bytes(small, smoothed(open_plane(), {3, 1})));
}

TEST(SmoothCancellation, BeforeTheStartEndsBothKernels) {
  Mesh mesh = open_noise();
  std::stop_source source;
  source.request_stop();
  const Context stopped{source.get_token(), {}};
  Connectivity connectivity;
  EXPECT_TRUE(is_cancelled([&] { build_connectivity(mesh, stopped, connectivity); }));
  build_connectivity(mesh, {}, connectivity);
  Buffer<Vec3> scratch;
  EXPECT_TRUE(is_cancelled([&] {
    smooth_laplacian(connectivity, {5, 1}, stopped, mesh, scratch);
  }));
}

TEST(SmoothCancellation, BetweenPassesEndsTheKernel) {
  Mesh mesh = open_noise();
  Connectivity connectivity;
  build_connectivity(mesh, {}, connectivity);
  std::stop_source source;
  const Context stops_itself{source.get_token(), [&](double) { source.request_stop(); }};
  Buffer<Vec3> scratch;
  EXPECT_TRUE(is_cancelled([&] {
    smooth_laplacian(connectivity, {1000, 1}, stops_itself, mesh, scratch);
  }));
}

TEST(SmoothProgress, RisesToOne) {
  Mesh mesh = open_noise();
  Connectivity connectivity;
  build_connectivity(mesh, {}, connectivity);
  const test::ThreadCount one(1);
  std::vector<double> reports;
  const Context context{{}, [&](double share) { reports.push_back(share); }};
  Buffer<Vec3> scratch;
  smooth_laplacian(connectivity, {7, 1}, context, mesh, scratch);
  ASSERT_GE(reports.size(), 7U);
  EXPECT_GE(reports.front(), 0);
  EXPECT_TRUE(std::is_sorted(reports.begin(), reports.end()));
  EXPECT_DOUBLE_EQ(reports.back(), 1);
}

}  // namespace
}  // namespace isomesh::mesh
