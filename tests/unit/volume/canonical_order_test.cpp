// The canonical order of axes and the numbers of the canonical geometry.

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <stop_token>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"
#include "server/volume/geometry.h"
#include "server/volume/sample_order.h"

namespace isomesh::volume::test {
namespace {

using Dims = std::array<std::uint32_t, 3>;
using Direction = std::array<double, 9>;

// All ways in which a file may store a lattice: any axis first, from either end.
std::vector<AxisOrder> storages() {
  std::vector<AxisOrder> orders;
  AxisOrder axes = kFilesOrder;
  do {
    for (unsigned signs = 0; signs < 8; ++signs) {
      AxisOrder order = axes;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if ((signs >> axis & 1U) != 0) order[axis] = -order[axis];
      }
      orders.push_back(order);
    }
  } while (std::ranges::next_permutation(axes).found);
  return orders;
}

double determinant(const Direction& m) {
  return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) +
         m[2] * (m[3] * m[7] - m[4] * m[6]);
}

Direction rotation(double angle, Vector3 axis) {
  const double length = std::hypot(axis[0], axis[1], axis[2]);
  for (double& part : axis) part /= length;
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  const auto& [x, y, z] = axis;
  return {c + x * x * (1 - c),     x * y * (1 - c) - z * s, x * z * (1 - c) + y * s,
          y * x * (1 - c) + z * s, c + y * y * (1 - c),     y * z * (1 - c) - x * s,
          z * x * (1 - c) - y * s, z * y * (1 - c) + x * s, c + z * z * (1 - c)};
}

// As a file holds the lattice whose affine matrix is in single precision.
Geometry in_single_precision(const Geometry& geometry) {
  const auto single = [](Vector3 numbers) {
    for (double& number : numbers) number = static_cast<float>(number);
    return numbers;
  };
  return normalised(geometry_of(
      single(geometry.origin),
      {single(step_of(geometry, 0)), single(step_of(geometry, 1)), single(step_of(geometry, 2))}));
}

// The lattices of the tests: along the axes, oblique in any way, halfway between axes, sheared, and
// left-handed.
std::vector<Geometry> lattices() {
  constexpr double kQuarter = std::numbers::pi / 4;
  std::vector<Geometry> all = {
      {.origin = {-50.3, 12.7, 0.05}, .spacing = {0.7, 0.8, 1.5}},
      {.spacing = {0.7, 0.8, 1.5}, .direction = rotation(kQuarter, {0, 0, 1})},
      {.spacing = {1, 1, 1}, .direction = rotation(kQuarter, {0, 1, 0})},
      {.spacing = {1, 2, 3}, .direction = rotation(kQuarter, {1, 1, 0})},
      // All three axes are equally near.
      {.spacing = {1, 1, 2}, .direction = rotation(std::numbers::pi / 3, {1, 1, 1})},
  };
  std::mt19937 random(7);
  std::uniform_real_distribution<double> number(-1, 1);
  for (int at = 0; at < 40; ++at) {
    Geometry oblique = {.origin = {300 * number(random), 300 * number(random), 9 * number(random)},
                        .spacing = {1.2 + number(random), 1.2 + number(random), 2.7},
                        .direction = rotation(3 * number(random), {number(random), 1, 0.3})};
    if (at % 4 == 0) {  // a skewed lattice, as of a tilted gantry
      const double shear = std::sin(0.4 * number(random));
      for (std::size_t row = 0; row < 3; ++row) {
        double& part = oblique.direction[row * 3 + 2];
        part = part * std::sqrt(1 - shear * shear) + shear * oblique.direction[row * 3 + 1];
      }
    }
    all.push_back(oblique);
  }
  return all;
}

constexpr Dims kDims = {181, 512, 33};

TEST(CanonicalOrder, IsThatOfThePatientForAllStoragesAlongItsAxes) {
  const Geometry patient = {.origin = {-9, 4, 7}, .spacing = {0.7, 0.8, 1.5}};
  for (const AxisOrder& storage : storages()) {
    const Geometry stored = in_order(kDims, patient, storage);
    const Dims dims = in_order(kDims, storage);
    const AxisOrder order = canonical_order(stored);
    EXPECT_EQ(in_order(dims, order), kDims) << to_string(storage);
    EXPECT_EQ(canonical_geometry(dims, stored), patient) << to_string(storage);
  }
}

TEST(CanonicalOrder, OfAnyLatticeDoesNotDependOnItsStorage) {
  for (const Geometry& lattice : lattices()) {
    const Geometry expected = canonical_geometry(kDims, lattice);
    const Dims dims = in_order(kDims, canonical_order(lattice));
    for (const AxisOrder& storage : storages()) {
      const Geometry stored = in_order(kDims, lattice, storage);
      const Dims stored_dims = in_order(kDims, storage);
      EXPECT_EQ(in_order(stored_dims, canonical_order(stored)), dims) << to_string(storage);
      EXPECT_EQ(canonical_geometry(stored_dims, stored), expected) << to_string(storage);
    }
  }
}

// An independent look at the rule: no right-handed order follows the patient better.
TEST(CanonicalOrder, IsRightHandedAndNearestToThePatient) {
  const auto sum = [](const Direction& d) { return d[0] + d[4] + d[8]; };
  for (const Geometry& lattice : lattices()) {
    const Geometry canonical = canonical_geometry(kDims, lattice);
    EXPECT_GT(determinant(canonical.direction), 0);
    for (const AxisOrder& storage : storages()) {
      const Geometry other = in_order(kDims, lattice, storage);
      if (determinant(other.direction) < 0) continue;
      EXPECT_LE(sum(other.direction), sum(canonical.direction) + 1.1e-4);
    }
  }
}

TEST(CanonicalOrder, IsKeptByARepetition) {
  for (const Geometry& lattice : lattices()) {
    const Geometry once = canonical_geometry(kDims, lattice);
    const Dims dims = in_order(kDims, canonical_order(lattice));
    EXPECT_EQ(canonical_order(once), kFilesOrder);
    EXPECT_EQ(canonical_geometry(dims, once), once);
  }
}

// Sums of cosines that differ by 1e-4, the border of the rule, but for the rounding of cosines.
TEST(CanonicalOrder, IsKeptByARepetitionNearTheBorderOfTies) {
  const double border = std::asin(1e-4 / (2 * std::numbers::sqrt2));
  std::mt19937 random(11);
  std::uniform_real_distribution<double> offset(-1e-9, 1e-9);
  for (int at = 0; at < 3000; ++at) {
    Vector3 axis = {0, 0, 0};
    axis[static_cast<std::size_t>(at % 3)] = 1;
    const double angle = std::numbers::pi / 4 + (at % 2 == 0 ? border : -border) + offset(random);
    const Geometry lattice = {.spacing = {1, 2, 3}, .direction = rotation(angle, axis)};
    Dims dims = kDims;
    Geometry once = lattice;
    EXPECT_EQ(make_canonical(dims, once), canonical_order(lattice));
    const Geometry first = once;
    ASSERT_EQ(make_canonical(dims, once), kFilesOrder) << angle;
    EXPECT_EQ(once, first);
  }
}

// Two changes one after another are the change that their sum names, also of a volume whose axes
// are in the order of a file. The copy between has those of the patient.
TEST(CanonicalOrder, OfACopyKeepsTheSumOfItsChanges) {
  const auto inverse = [](const AxisOrder& order) {
    AxisOrder back = {};
    for (std::size_t at = 0; at < order.size(); ++at) {
      const int axis = static_cast<int>(at) + 1;
      back[static_cast<std::size_t>(std::abs(order[at]) - 1)] = order[at] < 0 ? -axis : axis;
    }
    return back;
  };
  const std::vector<AxisOrder> seconds = {{1, 2, 3}, {-1, 2, 3}, {1, 2, -3}, {2, -1, 3}, {3, 1, 2}};
  const Geometry patient = {.origin = {-9, 4, 7}, .spacing = {0.7, 0.8, 1.5}};
  for (const AxisOrder& storage : storages()) {
    const Geometry stored = in_order(kDims, patient, storage);
    for (const AxisOrder& first : storages()) {
      for (const AxisOrder& second : seconds) {
        Dims dims = in_order(kDims, storage);
        Geometry copy = reoriented(dims, stored, first);
        AxisOrder moved = make_canonical(dims, copy);
        const AxisOrder total = along_patient(in_turn(second, along_patient(first, stored)), copy);
        for (const AxisOrder& change : {second, inverse(total)}) {
          copy = reoriented(dims, copy, change);
          moved = in_turn(moved, make_canonical(dims, copy));
        }
        // The samples are where those of the first volume are in the canonical order.
        ASSERT_EQ(moved, canonical_order(stored)) << to_string(first) << ' ' << to_string(second);
        EXPECT_EQ(copy, patient);
      }
    }
  }
}

TEST(CanonicalOrder, LeavesTheCornersOfALatticeInTheirPlaces) {
  for (const Geometry& lattice : lattices()) {
    const AxisOrder order = canonical_order(lattice);
    const Geometry before = in_order(kDims, lattice, order);
    const Geometry after = canonical_geometry(kDims, lattice);
    const Dims dims = in_order(kDims, order);
    double way = 0;  // from the middle to a corner, along the axes
    for (std::size_t axis = 0; axis < 3; ++axis) way += after.spacing[axis] * (dims[axis] - 1) / 2;
    const double most = 1.1e-4 * std::ranges::min(after.spacing) + 5e-7 * way;
    for (unsigned corner = 0; corner < 8; ++corner) {
      Vector3 between = {};
      for (std::size_t row = 0; row < 3; ++row)
        between[row] = before.origin[row] - after.origin[row];
      for (int axis = 0; axis < 3; ++axis) {
        const double steps =
            (corner >> axis & 1U) == 0 ? 0 : dims[static_cast<std::size_t>(axis)] - 1.0;
        for (std::size_t row = 0; row < 3; ++row) {
          between[row] += steps * (step_of(before, axis)[row] - step_of(after, axis)[row]);
        }
      }
      for (const double coordinate : between) EXPECT_LE(std::abs(coordinate), most);
    }
  }
}

// nibabel computes the other end of an axis from numbers in single precision, and stores it so.
TEST(CanonicalOrder, FindsTheNumbersThatSinglePrecisionRounded) {
  for (const double spacing : {0.5, 0.7, 0.8, 0.9, 1.0, 1.2, 1.5, 2.0}) {
    const Geometry chosen = {.origin = {-50.3, -127.45, 31.2}, .spacing = {spacing, spacing, 1.5}};
    const Dims dims = {256, 256, 180};
    const Geometry first = in_single_precision(chosen);
    EXPECT_EQ(canonical_geometry(dims, first), chosen);
    for (const AxisOrder& storage : storages()) {
      const Geometry stored = in_single_precision(in_order(dims, first, storage));
      EXPECT_EQ(canonical_geometry(in_order(dims, storage), stored), chosen)
          << spacing << ' ' << to_string(storage);
    }
  }
}

// Numbers of a text, which are exact, stay or move by less than 1e-4 of a sample.
TEST(CanonicalOrder, LeavesDecimalsOfAHeaderAlone) {
  const auto expect = [](const Vector3& origin, const Vector3& spacing, const Vector3& rounded) {
    EXPECT_EQ(canonical_geometry({512, 512, 200}, {.origin = origin, .spacing = spacing}),
              (Geometry{.origin = rounded, .spacing = spacing}));
  };
  expect({-120.25, 0.5, 33.3}, {0.5, 0.9766, 0.9765625}, {-120.25, 0.5, 33.3});
  expect({-171.6992, -324.1993, -1043.75}, {0.683594, 0.683594, 1.25},
         {-171.6992, -324.1993, -1043.75});
  expect({-171.699219, -324.199319, -1043.75}, {0.683594, 0.683594, 1.25},
         {-171.6992, -324.1993, -1043.75});
  expect({-0.0015, 0.00025, 12}, {2e-6, 3e-6, 4e-6}, {-0.0015, 0.00025, 12});
}

// Steps of the grids change at borders, between which a number must not fall.
TEST(CanonicalOrder, HasGridsThatMeetAtTheirBorders) {
  std::mt19937 random(13);
  std::uniform_real_distribution<double> noise(-1, 1);
  for (const double border : {0.5, 0.7, 1.0, 1.4, 2.5, 2.8, 5.0, 7.0, 10.0}) {
    for (const double scale : {1e-4, 1e-2, 1.0, 100.0}) {
      const Geometry chosen = {.origin = {-12 * scale, 3 * scale, 0},
                               .spacing = {border * scale, 20 * scale, 20 * scale}};
      for (int at = 0; at < 200; ++at) {
        Geometry near = chosen;
        near.spacing[0] *= 1 + noise(random) * 0x1p-24;
        EXPECT_EQ(canonical_geometry(kDims, near), canonical_geometry(kDims, chosen));
        near.spacing[0] = chosen.spacing[0] * (1 + noise(random) * 1e-6);
        near.origin[1] += noise(random) * scale;
        const Geometry once = canonical_geometry(kDims, near);
        EXPECT_EQ(canonical_geometry(kDims, once), once) << border << ' ' << scale;
      }
    }
  }
}

// No number of these lattices is one that people choose. Each of the 48 files of a lattice has
// other errors of rounding, so a border of a grid may lie between them.
TEST(CanonicalOrder, MostlyFindsALatticeThatSinglePrecisionRounded) {
  int differing = 0;
  int all = 0;
  std::mt19937 random(17);
  std::uniform_real_distribution<double> number(-1, 1);
  for (int at = 0; at < 100; ++at) {
    const Geometry lattice = in_single_precision(
        {.origin = {100 * number(random), 100 * number(random), 100 * number(random)},
         .spacing = {1.2 + number(random) / 5, 1.2 + number(random) / 5, 1.2 + number(random) / 5},
         .direction = rotation(0.6 * number(random), {number(random), number(random), 1})});
    const Dims dims = {181, 217, 181};
    const Geometry expected = canonical_geometry(dims, lattice);
    for (const AxisOrder& storage : storages()) {
      const Geometry stored = in_single_precision(in_order(dims, lattice, storage));
      const bool is_found = canonical_geometry(in_order(dims, storage), stored) == expected;
      differing += is_found ? 0 : 1;
      ++all;
    }
  }
  EXPECT_EQ(all, 4800);
  EXPECT_LE(differing, 480);
}

TEST(CanonicalOrder, IsToldByLettersAsOfNibabel) {
  EXPECT_EQ(axis_codes({}), "LPS");
  const auto codes = [](const AxisOrder& storage) {
    return axis_codes(in_order(kDims, {}, storage));
  };
  EXPECT_EQ(codes({-1, -2, 3}), "RAS");
  EXPECT_EQ(codes({1, -2, 3}), "LAS");
  EXPECT_EQ(codes({-2, 3, 1}), "ASL");
  EXPECT_EQ(codes({-3, -1, -2}), "IRA");
  EXPECT_EQ(codes({2, -3, 1}), "PIL");
}

// Sample (i,j,k) of the result is compared with the one that the order names.
template <class Sample>
void expect_in_order(const Dims& dims) {
  std::vector<Sample> samples(std::size_t{dims[0]} * dims[1] * dims[2]);
  std::mt19937 random(3);
  std::ranges::generate(samples, [&] { return static_cast<Sample>(random()); });
  for (const AxisOrder& order : storages()) {
    std::vector<Sample> moved = samples;
    put_in_order(std::as_writable_bytes(std::span(moved)), sizeof(Sample), dims, order);
    const Dims after = in_order(dims, order);
    std::vector<Sample> expected;
    for (std::size_t k = 0; k < after[2]; ++k) {
      for (std::size_t j = 0; j < after[1]; ++j) {
        for (std::size_t i = 0; i < after[0]; ++i) {
          const std::array<std::size_t, 3> place = {i, j, k};
          std::array<std::size_t, 3> from = {};
          for (std::size_t axis = 0; axis < 3; ++axis) {
            const auto source = static_cast<std::size_t>(std::abs(order[axis]) - 1);
            from[source] = order[axis] < 0 ? dims[source] - 1 - place[axis] : place[axis];
          }
          expected.push_back(samples[from[0] + dims[0] * (from[1] + dims[1] * from[2])]);
        }
      }
    }
    ASSERT_EQ(moved, expected) << to_string(order);
  }
}

TEST(SampleOrder, MovesSamplesOfAllSizes) {
  for (const Dims& dims : {Dims{1, 1, 1}, Dims{5, 1, 3}, Dims{3, 67, 2}, Dims{70, 65, 3},
                           Dims{16, 32, 17}, Dims{2, 9, 81}}) {
    expect_in_order<std::uint8_t>(dims);
    expect_in_order<std::uint16_t>(dims);
    expect_in_order<std::uint32_t>(dims);
    expect_in_order<std::uint64_t>(dims);
  }
}

TEST(SampleOrder, EndsWhenItIsStopped) {
  std::stop_source source;
  source.request_stop();
  std::vector<std::byte> samples(60);
  for (const AxisOrder& order : storages()) {
    if (order == kFilesOrder) continue;
    try {
      put_in_order(samples, 1, {5, 4, 3}, order, source.get_token());
      ADD_FAILURE() << to_string(order);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCancelled);
    }
  }
}

}  // namespace
}  // namespace isomesh::volume::test
