#include "server/volume/geometry.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace isomesh::volume::test {
namespace {

constexpr std::array<std::uint32_t, 3> kDims = {10, 10, 10};

std::string faulty_field(const Geometry& geometry) {
  const auto fault = find_fault(kDims, geometry);
  return fault ? fault->field : "";
}

TEST(Geometry, IsTakenApartIntoSpacingAndDirection) {
  const Geometry geometry = geometry_of({1, 2, 3}, {{{0, 2, 0}, {-3, 0, 0}, {0, 0, 0.5}}});
  EXPECT_EQ(geometry.origin, (Vector3{1, 2, 3}));
  EXPECT_EQ(geometry.spacing, (Vector3{2, 3, 0.5}));
  EXPECT_EQ(geometry.direction, (std::array<double, 9>{0, -1, 0, 1, 0, 0, 0, 0, 1}));
  EXPECT_EQ(step_of(geometry, 1), (Vector3{-3, 0, 0}));
  EXPECT_EQ(faulty_field(geometry), "");
}

TEST(Geometry, MayBeShearedAndLeftHanded) {
  Geometry geometry = geometry_of({0, 0, 0}, {{{1, 0, 0}, {0, 1, 0}, {0, 0.3, 2}}});
  EXPECT_EQ(faulty_field(geometry), "");
  geometry.direction[0] = -1;
  EXPECT_EQ(faulty_field(geometry), "");
}

TEST(Geometry, IsRefusedByField) {
  const double nan = std::nan("");
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double bad : {nan, infinity, 0.0, -1.0}) {
    EXPECT_EQ(faulty_field({.spacing = {1, bad, 1}}), "spacing");
  }
  EXPECT_EQ(faulty_field({.origin = {0, 0, nan}}), "origin");
  EXPECT_EQ(faulty_field({.origin = {0, -infinity, 0}}), "origin");
  EXPECT_EQ(faulty_field({.direction = {1, 0, 0, 0, 1, 0, 0, 0, nan}}), "direction");
  EXPECT_EQ(faulty_field({.direction = {1, 0, 0, 0, 1, 0, 0, 0, 0}}), "direction");
  EXPECT_EQ(faulty_field({.direction = {1, 0, 0, 0, 1, 0, 0, 0, 2}}), "direction");
  EXPECT_EQ(faulty_field({.direction = {1, 1, 0, 0, 0, 0, 0, 0, 1}}), "direction");
}

TEST(Geometry, OfAStepWithoutALengthIsRefusedByItsSpacing) {
  const Geometry geometry = geometry_of({0, 0, 0}, {{{0, 0, 0}, {0, 1, 0}, {0, 0, 1}}});
  const auto fault = find_fault({2, 2, 2}, normalised(geometry));
  ASSERT_TRUE(fault);
  EXPECT_NE(fault->message.find("along i is 0 mm"), std::string::npos) << fault->message;
}

TEST(Geometry, IsRefusedWhereSinglePrecisionEnds) {
  EXPECT_EQ(faulty_field({.origin = {65000, 0, 0}}), "");
  EXPECT_EQ(faulty_field({.origin = {66000, 0, 0}}), "origin");
  EXPECT_EQ(faulty_field({.origin = {0, 0, -66000}}), "origin");
  EXPECT_EQ(faulty_field({.spacing = {1, 1, 1e-5}}), "origin");
}

TEST(Geometry, GivesLengthsOfDirectionsToTheSpacing) {
  const Geometry geometry =
      normalised({.spacing = {1, 2, 3}, .direction = {2, 0, 0, 0, 1.0001, 0, 0, 0, -0.5}});
  EXPECT_EQ(geometry.spacing, (Vector3{2, 2, 1.5}));
  EXPECT_EQ(geometry.direction, (std::array<double, 9>{1, 0, 0, 0, 1.0001, 0, 0, 0, -1}));
}

}  // namespace
}  // namespace isomesh::volume::test
