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

TEST(Geometry, IsFlippedAndTurnedAboutItsCentre) {
  const std::array<std::uint32_t, 3> dims = {3, 5, 2};
  const Geometry before = geometry_of({10, 20, 30}, {{{1, 0, 0}, {0, 2, 0}, {0, 0, 4}}});
  const Geometry flipped = reoriented(dims, before, {-1, 2, 3});
  EXPECT_EQ(flipped.origin, (Vector3{12, 20, 30}));
  EXPECT_EQ(step_of(flipped, 0), (Vector3{-1, 0, 0}));
  EXPECT_EQ(step_of(flipped, 1), step_of(before, 1));
  EXPECT_EQ(reoriented(dims, flipped, {-1, 2, 3}), before);
  const Geometry turned = reoriented(dims, before, {2, -1, 3});
  EXPECT_EQ(turned.spacing, before.spacing);
  EXPECT_EQ(step_of(turned, 0), (Vector3{0, 1, 0}));
  EXPECT_EQ(step_of(turned, 1), (Vector3{-2, 0, 0}));
  // The centre (11, 24, 32), less a step along i and two along j.
  EXPECT_EQ(turned.origin, (Vector3{15, 23, 30}));
}

TEST(Geometry, OfShearedAxesIsFlippedButNotTurned) {
  const Geometry sheared = geometry_of({0, 0, 0}, {{{1, 0, 0}, {0, 1, 0}, {0, 0.3, 2}}});
  EXPECT_EQ(step_of(reoriented(kDims, sheared, {1, 2, -3}), 2), (Vector3{0, -0.3, -2}));
  EXPECT_THROW(reoriented(kDims, sheared, {1, 3, 2}), Error);
}

TEST(Geometry, OrderOfAxesIsText) {
  EXPECT_EQ(parse_axis_order("y,-x,z"), (AxisOrder{2, -1, 3}));
  EXPECT_EQ(to_string(AxisOrder{2, -1, 3}), "y,-x,z");
  for (const char* wrong :
       {"", "x,y", "x,x,z", "x,-x,z", "x,y,z,x", "x,y,w", "--x,y,z", "xy,y,z"}) {
    EXPECT_FALSE(parse_axis_order(wrong)) << wrong;
  }
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
