// The proof notices damage, and the two tests of a triangle's sign agree with each other and with
// many values of the field.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <random>

#include <gtest/gtest.h>

#include "server/mesh/bound/bound.h"
#include "server/mesh/bound/clear.h"
#include "server/mesh/bound/collapses.h"
#include "server/mesh/bound/one_sign.h"
#include "server/mesh/bound/proof.h"
#include "server/mesh/bound/start.h"
#include "tests/support/kernels.h"
#include "tests/support/shapes.h"

namespace isomesh::mesh::bound {
namespace {

constexpr double kReach = 0.2;

// A tube around the surface of a volume.
struct Scene {
  test::SampleVolume<float> volume;
  Mesh mesh;
  Metric metric;
  std::optional<Field> field;
  std::vector<Crossing> crossings;
  Tube tube;
  std::vector<std::uint32_t> origins;

  explicit Scene(test::SampleVolume<float> samples)
      : volume(std::move(samples)),
        mesh(test::extracted(volume, {})),
        metric(volume.lattice().to_space),
        field(make_field(volume.lattice(), {}, 0, {})),
        crossings(crossings_of(*field, {})),
        tube(make_start({*field, crossings, metric, mesh, kReach},
                        find_clusters(volume.lattice(), {}, *field, crossings, {}), {})
                 .value()),
        origins(crossings.size()) {
    collapse_edges(*field, metric, {.reach_mm = kReach}, {}, tube);
    std::iota(origins.begin(), origins.end(), 0U);
  }
  Proof prove() const {
    return bound::prove(
        *field, {crossings, mesh.triangles.span(), tube.vertices, tube.triangles, origins}, {});
  }
};

// A large ball, a small one, and a tunnel that leaves the volume through a face.
Scene balls_and_tunnel() {
  const auto field = [](const test::Point& p) {
    const double large = 5.1 - std::hypot(p[0] - 8, p[1] - 8, p[2] - 8);
    const double small = 2.2 - std::hypot(p[0] - 18, p[1] - 7, p[2] - 8);
    const double tunnel = 2.4 - std::hypot(p[1] - 16, p[2] - 12);
    return std::max({large, small, tunnel});
  };
  return Scene(test::sample<float>(field, {24, 22, 18}));
}

TEST(BoundProofTest, HoldsForATube) {
  const Scene scene = balls_and_tunnel();
  const Proof proof = scene.prove();
  EXPECT_TRUE(proof.holds());
  EXPECT_EQ(proof.components, 3U);
  EXPECT_LT(scene.tube.triangles.size(), scene.mesh.triangles.size() / 2);
}

TEST(BoundProofTest, RefusesARemovedTriangle) {
  Scene scene = balls_and_tunnel();
  scene.tube.triangles.erase(scene.tube.triangles.begin() + 20);
  EXPECT_GT(scene.prove().open_edges, 0U);
}

TEST(BoundProofTest, RefusesAPushedVertex) {
  Scene scene = balls_and_tunnel();
  Vertex& vertex = scene.tube.vertices[scene.tube.triangles[20][0]];
  const Vecf push = (vertex.in - vertex.out) * 0.75F;
  vertex = {vertex.p + push, snap(wide(vertex.in + push)), snap(wide(vertex.out + push))};
  EXPECT_GT(scene.prove().unclear_triangles, 0U);
}

TEST(BoundProofTest, RefusesARemovedComponent) {
  Scene scene = balls_and_tunnel();
  std::erase_if(scene.tube.triangles, [&](const Triangle& triangle) {
    const Vecf p = scene.tube.vertices[triangle[0]].p;
    return p.x > 15 && p.y < 11;
  });
  const Proof proof = scene.prove();
  EXPECT_EQ(proof.open_edges, 0U);
  EXPECT_EQ(proof.uncovered.size(), 1U);
}

// The tunnel's end is closed by a fan that lies in the volume's face.
TEST(BoundProofTest, RefusesAClosedHole) {
  Scene scene = balls_and_tunnel();
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

TEST(BoundProofTest, RefusesABorderThatLeftItsFace) {
  Scene scene = balls_and_tunnel();
  for (const std::uint32_t v : scene.tube.triangles.back()) {
    if (scene.tube.border[v] != 0) scene.tube.vertices[v].p.x -= 0.01F;
  }
  for (Vertex& vertex : scene.tube.vertices) {
    if (vertex.p.x == 0) vertex.p.x = 0.01F;
  }
  EXPECT_GT(scene.prove().open_edges, 0U);
}

// The bound of a file follows from where its vertices are.
TEST(BoundProofTest, TellsThatAVertexWasMoved) {
  const Scene scene = balls_and_tunnel();
  Mesh mesh = test::extracted(scene.volume, {});
  std::string why_not;
  const auto bound =
      simplify_within(scene.volume.lattice(), {}, {.max_error_mm = 0.2}, {}, mesh, why_not);
  ASSERT_TRUE(bound);
  mesh.positions[7][1] += 0.3F;
  EXPECT_GT(bound->bound_at(mesh.positions.span()), 0.2);
  mesh.positions[7][1] = std::nanf("");
  EXPECT_FALSE(bound->bound_at(mesh.positions.span()) <= 0.2);
}

class RandomTriangles {
 public:
  explicit RandomTriangles(const Dims& dims) : dims_(dims) {}

  double number() { return static_cast<double>(random_()) / 4294967296.0; }

  std::array<Vecf, 3> next() {
    const double size = 0.1 + 5 * number() * number();
    const Vecd at = {number() * (dims_.x - 1), number() * (dims_.y - 1), number() * (dims_.z - 1)};
    const auto near = [&](double x, std::uint32_t samples) {
      double moved = x + size * (number() - 0.5);
      if (number() < 0.2) moved = std::round(moved);  // on planes and lines
      return std::clamp(moved, 0.0, samples - 1.0);
    };
    std::array<Vecf, 3> corners;
    for (Vecf& corner : corners) {
      corner = snap({near(at.x, dims_.x), near(at.y, dims_.y), near(at.z, dims_.z)});
    }
    return corners;
  }

 private:
  const Dims dims_;
  std::mt19937 random_{4};
};

bool is_clear(const Field& field, const std::array<Vecf, 3>& p, double sign) {
  Clear clear(field);
  clear.base(p[0]);
  const PlaneNumbers a = clear.at(p[0]);
  const PlaneNumbers b = clear.at(p[1]);
  const PlaneNumbers c = clear.at(p[2]);
  return clear.point(a, sign) && clear.point(b, sign) && clear.point(c, sign) &&
         clear.edge(a, b, sign) && clear.edge(b, c, sign) && clear.edge(c, a, sign) &&
         clear.inside(a, b, c, sign);
}

// The least of sign * F at many points of the triangle.
double least_value(const Field& field, const std::array<Vecf, 3>& p, double sign) {
  Clear clear(field);
  double least = 1e30;
  constexpr int kSteps = 40;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; i + j <= kSteps; ++j) {
      const float u = static_cast<float>(i) / kSteps;
      const float v = static_cast<float>(j) / kSteps;
      const Vecf at = p[0] + (p[1] - p[0]) * u + (p[2] - p[0]) * v;
      if (!clear.contains(at)) continue;  // rounded beyond the border
      clear.base(at);
      least = std::min(least, sign * clear.value(clear.at(at)));
    }
  }
  return least;
}

TEST(BoundProofTest, BothTestsOfATriangleAgreeWithManyValues) {
  const Dims dims = {9, 8, 7};
  RandomTriangles triangles(dims);
  int clear = 0;
  for (int n = 0; n < 4000; ++n) {
    static std::optional<Field> field;
    if (n % 100 == 0) {
      auto volume = test::noise_between<float>(-0.25, n % 300 == 0 ? 0.75 : 1.75, dims,
                                               static_cast<std::uint64_t>(n));
      field = make_field(volume.lattice(), {}, 0, {});
    }
    const std::array<Vecf, 3> corners = triangles.next();
    const double sign = n % 5 == 0 ? -1 : 1;
    const bool fast = is_clear(*field, corners, sign);
    EXPECT_EQ(fast,
              has_one_sign(*field, wide(corners[0]), wide(corners[1]), wide(corners[2]), sign));
    const double least = least_value(*field, corners, sign);
    EXPECT_TRUE(fast ? least > 0 : least < 30);  // of 256: none is refused far from zero
    clear += fast ? 1 : 0;
  }
  EXPECT_GT(clear, 300);
  EXPECT_LT(clear, 3700);
}

}  // namespace
}  // namespace isomesh::mesh::bound
