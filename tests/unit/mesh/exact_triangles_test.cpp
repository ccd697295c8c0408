#include "server/mesh/measure/exact_triangles.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "tests/unit/mesh/cgal_triangles.h"

namespace isomesh::mesh {
namespace {

using Random = std::mt19937;
using Coordinate = std::function<float(Random&)>;

// Any finite float: of any magnitude, also denormal.
float any_float(Random& random) {
  float value = 0;
  do {
    value = std::bit_cast<float>(static_cast<std::uint32_t>(random()));
  } while (!std::isfinite(value));
  return value;
}

// Few whole numbers, so that many corners are on one line or in one plane.
float small_whole(Random& random) { return static_cast<float>(random() % 4); }

// Next to few whole numbers, so that rounding decides.
float next_to_whole(Random& random) {
  const float value = static_cast<float>(random() % 3 + 100);
  const float steps = static_cast<float>(random() % 3) - 1;
  return value + steps * 7.62939453125e-06F;  // the last bit
}

// Whole numbers, each times its own power of two: differences have many bits.
float of_two_sizes(Random& random) {
  return std::ldexp(static_cast<float>(random() % 3), random() % 2 == 0 ? -140 : 100);
}

// Corners of two triangles that have `shared` of them in common.
struct Two {
  std::vector<Vec3> positions;
  Triangle a;
  Triangle b;
};

Two two_of(const Coordinate& coordinate, std::uint32_t shared, Random& random) {
  Two two;
  for (std::uint32_t n = 0; n < 6 - shared; ++n) {
    two.positions.push_back({coordinate(random), coordinate(random), coordinate(random)});
  }
  two.a = {0, 1, 2};
  two.b = {3 - shared, 4 - shared, 5 - shared};
  std::shuffle(two.a.begin(), two.a.end(), random);
  std::shuffle(two.b.begin(), two.b.end(), random);
  return two;
}

// How often each answer comes: a test in which it never does would show nothing.
struct Seen {
  std::size_t flat = 0;
  std::size_t apart = 0;
  std::size_t intersecting = 0;
};

Seen compare_with_cgal(const Coordinate& coordinate, std::uint32_t shared) {
  constexpr std::size_t kPairs = 20000;
  Random random(7 + shared);
  Seen seen;
  for (std::size_t n = 0; n < kPairs; ++n) {
    const auto [positions, a, b] = two_of(coordinate, shared, random);
    bool has_flat = false;
    for (const Triangle& t : {a, b}) {
      const bool expected = test::is_flat_for_cgal(positions, t);
      EXPECT_EQ(is_flat(positions, t), expected) << n;
      has_flat = has_flat || expected;
    }
    if (has_flat) {
      ++seen.flat;
      do_intersect(positions, a, b);  // returns
      continue;
    }
    const bool expected = test::do_intersect_for_cgal(positions, a, b);
    EXPECT_EQ(do_intersect(positions, a, b), expected) << n;
    EXPECT_EQ(do_intersect(positions, b, a), expected) << n;
    ++(expected ? seen.intersecting : seen.apart);
  }
  return seen;
}

TEST(ExactTriangles, IntersectAsForCgal) {
  for (const std::uint32_t shared : {0U, 1U, 2U}) {
    SCOPED_TRACE(shared);
    for (const Coordinate& coordinate :
         {Coordinate(small_whole), Coordinate(next_to_whole), Coordinate(of_two_sizes)}) {
      const Seen seen = compare_with_cgal(coordinate, shared);
      EXPECT_GT(seen.flat, 50U);
      EXPECT_GT(seen.apart, 500U);
      EXPECT_GT(seen.intersecting, 50U);
    }
  }
}

TEST(ExactTriangles, OfAnyMagnitudeIntersectAsForCgal) {
  for (const std::uint32_t shared : {0U, 1U, 2U}) {
    SCOPED_TRACE(shared);
    EXPECT_GT(compare_with_cgal(any_float, shared).apart, 500U);
  }
}

}  // namespace
}  // namespace isomesh::mesh
