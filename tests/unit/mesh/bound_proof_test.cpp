// The proof notices damage.
#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include <gtest/gtest.h>

#include "server/mesh/collapse/bound.h"
#include "server/mesh/collapse/collapses.h"
#include "server/mesh/collapse/proof.h"
#include "server/mesh/collapse/start.h"
#include "tests/support/kernels.h"
#include "tests/support/shapes.h"

namespace isomesh::mesh::collapse {
namespace {

constexpr double kReach = 0.2;

// A tube around the surface of a volume.
struct Scene {
  test::SampleVolume<float> volume;
  Mesh mesh;
  Metric metric;
  std::optional<Field> field;
  Crossings crossings;
  Components components;
  Tube tube;

  explicit Scene(test::SampleVolume<float> samples, const ExtractOptions& options = {})
      : volume(std::move(samples)),
        mesh(test::extracted(volume, options)),
        metric(volume.lattice().to_space),
        field(make_field(volume.lattice(), options, 0, {})),
        crossings(crossings_of(*field, {})),
        tube(make_start({*field, crossings.all, metric, mesh, kReach},
                        find_clusters(volume.lattice(), options, *field, crossings, {}), {})
                 .value()) {
    find_components(mesh, {}, components);
    collapse_edges({*field, metric, kReach}, 0, {}, tube);
    tube.compact();
  }
  Scene(const Scene&) = delete;

  Proof prove() const {
    return collapse::prove(*field,
                           {crossings.all, mesh.triangles.span(), components, tube.vertices,
                            tube.triangles, tube.origins},
                           {});
  }
};

// A large ball, a small one, and a tunnel that leaves the volume through a face.
Scene balls_and_tunnel(Scheme scheme) {
  const auto field = [](const test::Point& p) {
    const double large = 5.1 - std::hypot(p[0] - 8, p[1] - 8, p[2] - 8);
    const double small = 2.2 - std::hypot(p[0] - 18, p[1] - 7, p[2] - 8);
    const double tunnel = 2.4 - std::hypot(p[1] - 16, p[2] - 12);
    return std::max({large, small, tunnel});
  };
  return Scene(test::sample<float>(field, {24, 22, 18}), {.scheme = scheme});
}

class BoundProofTest : public testing::TestWithParam<Scheme> {};

INSTANTIATE_TEST_SUITE_P(Schemes, BoundProofTest, testing::ValuesIn(test::kSchemes),
                         [](const auto& test) {
                           return std::to_string(static_cast<int>(test.param));
                         });

TEST_P(BoundProofTest, HoldsForATube) {
  const Scene scene = balls_and_tunnel(GetParam());
  EXPECT_TRUE(scene.prove().holds());
  EXPECT_EQ(scene.components.count, 3U);
  EXPECT_LT(scene.tube.triangles.size(), scene.mesh.triangles.size() / 2);
}

TEST_P(BoundProofTest, RefusesARemovedTriangle) {
  Scene scene = balls_and_tunnel(GetParam());
  scene.tube.triangles.erase(scene.tube.triangles.begin() + 20);
  EXPECT_GT(scene.prove().open_edges, 0U);
}

TEST_P(BoundProofTest, RefusesAPushedVertex) {
  Scene scene = balls_and_tunnel(GetParam());
  Vertex& vertex = scene.tube.vertices[scene.tube.triangles[20][0]];
  const Vecf push = (vertex.in - vertex.out) * 0.75F;
  vertex = {vertex.p + push, snap(wide(vertex.in + push)), snap(wide(vertex.out + push))};
  EXPECT_GT(scene.prove().unclear_triangles, 0U);
}

TEST_P(BoundProofTest, RefusesARemovedComponent) {
  Scene scene = balls_and_tunnel(GetParam());
  std::erase_if(scene.tube.triangles, [&](const Triangle& triangle) {
    const Vecf p = scene.tube.vertices[triangle[0]].p;
    return p.x > 15 && p.y < 11;
  });
  const Proof proof = scene.prove();
  EXPECT_EQ(proof.open_edges, 0U);
  EXPECT_EQ(proof.uncovered.size(), 1U);
}

// The tunnel's end is closed by a fan that lies in the volume's face.
TEST_P(BoundProofTest, RefusesAClosedHole) {
  Scene scene = balls_and_tunnel(GetParam());
  std::vector<Triangle> fan;
  std::optional<std::uint32_t> hub;
  for (const Triangle& triangle : scene.tube.triangles) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t a = triangle[i];
      const std::uint32_t b = triangle[(i + 1) % 3];
      const auto is_end = [&](std::uint32_t v) { return scene.tube.vertices[v].p.x == 0; };
      if (!is_end(a) || !is_end(b)) continue;
      if (!hub) hub = a;
      if (a != *hub && b != *hub) fan.push_back({*hub, b, a});
    }
  }
  ASSERT_GT(fan.size(), 3U);
  scene.tube.triangles.insert(scene.tube.triangles.end(), fan.begin(), fan.end());
  EXPECT_FALSE(scene.prove().holds());
}

TEST_P(BoundProofTest, RefusesABorderThatLeftItsFace) {
  Scene scene = balls_and_tunnel(GetParam());
  for (const std::uint32_t v : scene.tube.triangles.back()) {
    if (scene.tube.border[v] != 0) scene.tube.vertices[v].p.x -= 0.01F;
  }
  for (Vertex& vertex : scene.tube.vertices) {
    if (vertex.p.x == 0) vertex.p.x = 0.01F;
  }
  EXPECT_GT(scene.prove().open_edges, 0U);
}

// The bound of a file follows from where its vertices are.
TEST_P(BoundProofTest, TellsThatAVertexWasMoved) {
  const Scene scene = balls_and_tunnel(GetParam());
  const ExtractOptions options = {.scheme = GetParam()};
  Mesh mesh = test::extracted(scene.volume, options);
  const auto bound =
      simplify_within(scene.volume.lattice(), options, {.max_error_mm = 0.2}, {}, mesh);
  ASSERT_TRUE(bound);
  mesh.positions[7][1] += 0.3F;
  EXPECT_GT(bound->bound_at(mesh.positions.span()), 0.2);
  mesh.positions[7][1] = std::nanf("");
  EXPECT_FALSE(bound->bound_at(mesh.positions.span()) <= 0.2);
}

}  // namespace
}  // namespace isomesh::mesh::collapse
