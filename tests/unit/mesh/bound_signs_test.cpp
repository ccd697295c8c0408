// The tests of a triangle's sign agree with each other and with many values of the field. Compiled
// once for each instruction set: this file includes itself through Highway's foreach_target.h.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tests/unit/mesh/bound_signs_test.cpp"
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "server/mesh/collapse/bound.h"
#include "server/mesh/collapse/clear.h"
#include "server/mesh/collapse/fast_clear-inl.h"
#include "server/mesh/collapse/one_sign.h"
#include "tests/support/kernels.h"
#include "tests/support/shapes.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::collapse::HWY_NAMESPACE {

template <class Planes>
bool is_clear_in_lanes(const Field& field, const std::array<Vecf, 3>& p, Side side) {
  FastClear<Planes> clear(field);
  clear.base(p[0], 8);
  const auto at = [&](std::size_t i) { return clear.at(copies_of({p[i], p[i], p[i]}), side); };
  const auto a = at(0);
  const auto b = at(1);
  const auto c = at(2);
  const double sign = side == Side::kIn ? 1 : -1;
  return clear.point(a, sign) && clear.point(b, sign) && clear.point(c, sign) &&
         clear.edge(a, b, sign) && clear.edge(b, c, sign) && clear.edge(c, a, sign) &&
         clear.inside(a, b, c, sign);
}

bool is_clear_in_lanes_of_six(const Field& field, const std::array<Vecf, 3>& p, Side side) {
  return is_clear_in_lanes<SixPlanes>(field, p, side);
}

bool is_clear_in_lanes_of_bcc(const Field& field, const std::array<Vecf, 3>& p, Side side) {
  return is_clear_in_lanes<BccPlanes>(field, p, side);
}

}  // namespace isomesh::mesh::collapse::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace isomesh::mesh::collapse {
namespace {

HWY_EXPORT(is_clear_in_lanes_of_six);
HWY_EXPORT(is_clear_in_lanes_of_bcc);

// Calls body() on each instruction set that the sources are compiled for and the machine has.
template <class Body>
void on_each_instruction_set(Body body) {
  const auto use = [](std::int64_t targets) {
    hwy::SetSupportedTargetsForTest(targets);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  };
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    use(target);
    body();
  }
  use(0);
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

template <class Planes>
bool is_clear(const Field& field, const std::array<Vecf, 3>& p, double sign) {
  Clear<Planes> clear(field);
  clear.base(p[0]);
  const auto a = clear.at(p[0]);
  const auto b = clear.at(p[1]);
  const auto c = clear.at(p[2]);
  return clear.point(a, sign) && clear.point(b, sign) && clear.point(c, sign) &&
         clear.edge(a, b, sign) && clear.edge(b, c, sign) && clear.edge(c, a, sign) &&
         clear.inside(a, b, c, sign);
}

// The least of sign * F at many points of the triangle.
double least_value(const Field& field, const std::array<Vecf, 3>& p, double sign) {
  double least = 1e30;
  constexpr int kSteps = 40;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; i + j <= kSteps; ++j) {
      const float u = static_cast<float>(i) / kSteps;
      const float v = static_cast<float>(j) / kSteps;
      const Vecf at = p[0] + (p[1] - p[0]) * u + (p[2] - p[0]) * v;
      if (!field.contains(at)) continue;  // rounded beyond the border
      least = std::min(least, sign * value_at(field, at));
    }
  }
  return least;
}

struct Noise {
  Dims dims = {9, 8, 7};
  std::uint32_t margin = 0;
};

// Calls body(field, triangle, sign) for many of them, in noise.
template <class Body>
void for_random_triangles(Scheme scheme, Body body, const Noise& noise = {}) {
  const auto& [dims, margin] = noise;
  RandomTriangles triangles({dims.x + 2 * margin, dims.y + 2 * margin, dims.z + 2 * margin});
  std::optional<Field> field;
  for (int n = 0; n < 4000; ++n) {
    if (n % 100 == 0) {
      const auto volume = test::noise_between<float>(-0.25, n % 300 == 0 ? 0.75 : 1.75, dims,
                                                     static_cast<std::uint64_t>(n));
      field = make_field(volume.lattice(), {.scheme = scheme}, margin, {});
    }
    body(*field, triangles.next(), n % 5 == 0 ? -1.0 : 1.0);
  }
}

bool has_one_sign(const OneSign& sign, Vecd a, Vecd b, Vecd c) {
  return sign.at(a) && sign.at(b) && sign.at(c) && sign.along(a, b) && sign.along(b, c) &&
         sign.along(c, a) && sign.within(a, b, c);
}

template <class Planes>
void expect_agreement(Scheme scheme) {
  int clear = 0;
  for_random_triangles(scheme, [&](const Field& field, const std::array<Vecf, 3>& p, double sign) {
    const bool is_fast = is_clear<Planes>(field, p, sign);
    EXPECT_EQ(is_fast, has_one_sign(OneSign(field, sign), wide(p[0]), wide(p[1]), wide(p[2])));
    const double least = least_value(field, p, sign);
    EXPECT_TRUE(is_fast ? least > 0 : least < 30);  // of 256: none is refused far from zero
    clear += is_fast ? 1 : 0;
  });
  EXPECT_GT(clear, 300);
  EXPECT_LT(clear, 3700);
}

TEST(BoundSignsTest, AgreeWithManyValues) { expect_agreement<SixPlanes>(Scheme::kSix); }
TEST(BoundSignsTest, AgreeWithManyValuesOfFive) { expect_agreement<FivePlanes>(Scheme::kFive); }

TEST(BoundSignsTest, AgreeWithManyValuesOfBcc) { expect_agreement<BccPlanes>(Scheme::kBcc); }

// Beside phantoms, where cells have no centres.
TEST(BoundSignsTest, AgreeAroundAClosedVolumeOfBcc) {
  std::array<int, 2> clear = {};
  for_random_triangles(
      Scheme::kBcc,
      [&](const Field& field, const std::array<Vecf, 3>& p, double sign) {
        const bool is_fast = is_clear<BccPlanes>(field, p, sign);
        EXPECT_EQ(is_fast, has_one_sign(OneSign(field, sign), wide(p[0]), wide(p[1]), wide(p[2])));
        if (!is_fast) return;
        EXPECT_GT(least_value(field, p, sign), 0);
        ++clear[sign > 0 ? 0 : 1];
      },
      {.margin = 2});
  EXPECT_GT(clear[0], 200);
  EXPECT_GT(clear[1], 200);
}

// F of the body-centred lattice by its definition: in tetrahedra between two centres and a side of
// the face between their cells, and at the border between a centre and half a face.
TEST(BoundSignsTest, BccFollowsItsTetrahedra) {
  const Dims dims = {5, 4, 6};
  const auto volume = test::noise_between<float>(-0.25, 0.75, dims, 3);
  const auto field = make_field(volume.lattice(), {.scheme = Scheme::kBcc}, 0, {});
  ASSERT_TRUE(field);
  RandomTriangles random(dims);
  const auto value = [&](const Vecd& p) { return value_at(*field, narrow(p)); };
  const auto sample_at = [](double x, double y, double z) { return Vecd{x, y, z}; };
  const auto expect_linear = [&](const std::array<Vecd, 4>& corners) {
    std::array<double, 4> weights;
    double sum = 0;
    for (double& weight : weights) sum += weight = random.number();
    Vecd at;
    double expected = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      at = at + corners[i] * (weights[i] / sum);
      expected += value(corners[i]) * (weights[i] / sum);
    }
    EXPECT_NEAR(value(at), expected, 2e-3);  // places are in single precision
  };
  for (int n = 0; n < 4000; ++n) {
    const auto cell = [&](std::uint32_t samples) {
      return std::floor(random.number() * (samples - 1));
    };
    const Vecd low = sample_at(cell(dims.x), cell(dims.y), cell(dims.z));
    const Vecd centre = low + Vecd{0.5, 0.5, 0.5};
    std::array<Vecd, 3> axes = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    std::rotate(axes.begin(), axes.begin() + n % 3, axes.end());
    const auto& [normal, u, v] = axes;
    const bool is_high = random.number() < 0.5;
    const Vecd face = is_high ? low + normal : low;
    const Vecd beyond = is_high ? centre + normal : centre - normal;
    const std::array<Vecd, 4> square = {face, face + u, face + u + v, face + v};
    if (field->contains(narrow(beyond))) {
      const std::size_t side = n / 3 % 4;
      expect_linear({centre, beyond, square[side], square[(side + 1) % 4]});
    } else {
      expect_linear({centre, square[0], square[n / 3 % 2 == 0 ? 1 : 3], square[2]});
    }
  }
}

TEST(BoundSignsTest, AreTheSameInLanesOfEachInstructionSet) {
  const auto side_of = [](double sign) { return sign > 0 ? Side::kIn : Side::kOut; };
  on_each_instruction_set([&] {
    for_random_triangles(
        Scheme::kSix, [&](const Field& field, const std::array<Vecf, 3>& p, double sign) {
          EXPECT_EQ(HWY_DYNAMIC_DISPATCH(is_clear_in_lanes_of_six)(field, p, side_of(sign)),
                    is_clear<SixPlanes>(field, p, sign));
        });
    // Lanes are used away from the border, and beside phantoms there are other planes.
    for (const Noise& noise : {Noise{{27, 28, 29}, 0}, Noise{{9, 8, 7}, 2}}) {
      for_random_triangles(
          Scheme::kBcc,
          [&](const Field& field, const std::array<Vecf, 3>& p, double sign) {
            EXPECT_EQ(HWY_DYNAMIC_DISPATCH(is_clear_in_lanes_of_bcc)(field, p, side_of(sign)),
                      is_clear<BccPlanes>(field, p, sign));
          },
          noise);
    }
  });
}

TEST(BoundSignsTest, GiveTheSameMeshOnEachInstructionSet) {
  const auto volume = test::sample<float>(test::gyroid(9), {20, 19, 18});
  std::optional<std::vector<Vec3>> positions;
  on_each_instruction_set([&] {
    Mesh mesh = test::extracted(volume, {});
    ASSERT_TRUE(simplify_within(volume.lattice(), {}, {.max_error_mm = 0.1}, {}, mesh));
    const std::vector<Vec3> now(mesh.positions.begin(), mesh.positions.end());
    if (!positions) positions = now;
    EXPECT_TRUE(*positions == now);
  });
}

}  // namespace
}  // namespace isomesh::mesh::collapse
#endif  // HWY_ONCE
