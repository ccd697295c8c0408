#include "server/mesh/topology/topology.h"

#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/errors.h"
#include "tests/support/kernels.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"

namespace isomesh::mesh {
namespace {

using test::mesh_of;

// The result of the tests' own checks, which share no code with the measured one.
void expect_as_checked(const Mesh& mesh) {
  const test::TopologyFacts facts = test::topology_of(test::surface_of(mesh));
  const Topology topology = measure_topology(mesh, {});
  EXPECT_EQ(topology.boundary_edges, facts.boundary_edges.size());
  EXPECT_EQ(topology.manifold, facts.crowded_edges == 0 && facts.pinched_vertices == 0 &&
                                   facts.repeating_triangles == 0);
}

TEST(Topology, OfExtractedMeshesIsWhatAPlainCheckFinds) {
  for (const bool close : {false, true}) {
    for (const Scheme scheme : {Scheme::kFive, Scheme::kSix}) {
      const Mesh mesh = test::extracted(test::noise<std::uint8_t>({0, 1}, {21, 19, 45}, 4),
                                        {0.5, scheme, Interpolation::kLinear, close});
      expect_as_checked(mesh);
      const Topology topology = measure_topology(mesh, {});
      EXPECT_TRUE(topology.manifold);
      EXPECT_TRUE(topology.oriented);
      EXPECT_EQ(topology.boundary_edges == 0, close);
    }
  }
}

const std::vector<Vec3> kPoints = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1},
                                   {1, 1, 1}, {2, 0, 0}, {0, 2, 0}};
const std::vector<Triangle> kTetrahedron = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};

TEST(Topology, FindsNoFaultWhereThereIsNone) {
  const Topology topology = measure_topology(mesh_of(kPoints, kTetrahedron), {});
  EXPECT_TRUE(topology.manifold);
  EXPECT_TRUE(topology.oriented);
  EXPECT_EQ(topology.boundary_edges, 0U);
}

TEST(Topology, FindsABoundary) {
  const Mesh mesh = mesh_of(kPoints, {kTetrahedron.begin(), kTetrahedron.begin() + 3});
  const Topology topology = measure_topology(mesh, {});
  EXPECT_TRUE(topology.manifold);
  EXPECT_TRUE(topology.oriented);
  EXPECT_EQ(topology.boundary_edges, 3U);
  expect_as_checked(mesh);
}

TEST(Topology, FindsATriangleThatIsTurnedOver) {
  std::vector<Triangle> triangles = kTetrahedron;
  std::swap(triangles[3][1], triangles[3][2]);
  const Topology topology = measure_topology(mesh_of(kPoints, triangles), {});
  EXPECT_FALSE(topology.oriented);
  EXPECT_TRUE(topology.manifold);
}

TEST(Topology, FindsAnEdgeOfThreeTriangles) {
  std::vector<Triangle> triangles = kTetrahedron;
  triangles.push_back({0, 1, 4});
  EXPECT_FALSE(measure_topology(mesh_of(kPoints, triangles), {}).manifold);
  expect_as_checked(mesh_of(kPoints, triangles));
}

TEST(Topology, FindsAnEdgeOfFourTrianglesThatBalance) {
  std::vector<Triangle> triangles = kTetrahedron;
  for (const auto& [a, b, c] : {Triangle{0, 4, 1}, {0, 1, 5}, {0, 5, 4}, {1, 4, 5}}) {
    triangles.push_back({a, b, c});
  }
  const Topology topology = measure_topology(mesh_of(kPoints, triangles), {});
  EXPECT_FALSE(topology.manifold);
  EXPECT_EQ(topology.boundary_edges, 0U);
  expect_as_checked(mesh_of(kPoints, triangles));
}

TEST(Topology, FindsTwoFansAtOneVertex) {
  std::vector<Triangle> triangles = kTetrahedron;
  for (const auto& [a, b, c] : {Triangle{0, 5, 4}, {0, 4, 6}, {0, 6, 5}, {4, 5, 6}}) {
    triangles.push_back({a, b, c});
  }
  const Topology topology = measure_topology(mesh_of(kPoints, triangles), {});
  EXPECT_FALSE(topology.manifold);
  EXPECT_TRUE(topology.oriented);
  EXPECT_EQ(topology.boundary_edges, 0U);
  expect_as_checked(mesh_of(kPoints, triangles));
}

TEST(Topology, FindsATriangleTwice) {
  std::vector<Triangle> triangles = kTetrahedron;
  triangles.push_back(triangles[1]);
  const Topology topology = measure_topology(mesh_of(kPoints, triangles), {});
  EXPECT_FALSE(topology.manifold);
  EXPECT_FALSE(topology.oriented);
}

TEST(Topology, FindsATriangleThatNamesAVertexTwice) {
  EXPECT_FALSE(measure_topology(mesh_of(kPoints, {{0, 1, 1}}), {}).manifold);
}

// One corner changed anywhere in a large mesh, also between slabs, does not go unseen.
TEST(Topology, FindsAnyCornerThatIsWrong) {
  const Mesh sound = test::extracted(test::sample<float>(test::gyroid(7), {15, 14, 30}),
                                     {0, Scheme::kSix, Interpolation::kLinear, true});
  ASSERT_EQ(measure_topology(sound, {}).boundary_edges, 0U);
  for (std::size_t layer = 1; layer + 2 < sound.layers(); ++layer) {
    Mesh mesh = test::extracted(test::sample<float>(test::gyroid(7), {15, 14, 30}),
                                {0, Scheme::kSix, Interpolation::kLinear, true});
    const std::size_t first = mesh.layer_triangles[layer];
    const std::size_t t = first + (mesh.layer_triangles[layer + 1] - first) / 2;
    std::uint32_t& corner = mesh.triangles[t][layer % 3];
    corner = static_cast<std::uint32_t>(
        corner == mesh.layer_vertices[layer] ? corner + 1 : mesh.layer_vertices[layer]);
    EXPECT_GT(measure_topology(mesh, {}).boundary_edges, 0U) << layer;
  }
}

TEST(Topology, OfNothingIsSound) {
  const Topology topology = measure_topology(Mesh{}, {});
  EXPECT_TRUE(topology.manifold && topology.oriented);
  EXPECT_EQ(topology.boundary_edges, 0U);
}

TEST(Topology, StopsWhenItIsCancelled) {
  std::stop_source stop;
  stop.request_stop();
  const Context stopped = {stop.get_token(), {}};
  const Mesh mesh = mesh_of(kPoints, kTetrahedron);
  EXPECT_EQ(test::code_thrown_by([&] { measure_topology(mesh, stopped); }), ErrorCode::kCancelled);
}

}  // namespace
}  // namespace isomesh::mesh
