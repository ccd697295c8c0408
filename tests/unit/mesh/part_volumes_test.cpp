// Volumes of parts, and the planes that nothing crosses.
#include "server/mesh/collapse/part_volumes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/collapse/caps.h"
#include "server/mesh/collapse/swept.h"
#include "tests/unit/mesh/separated.h"

namespace isomesh::mesh::collapse {
namespace {

SeparatingSurface cells(bool close) {
  return separated(label_cells(4, {20, 18, 16}, 9, 31), {.labels = {1, 2, 3}, .close = close});
}

std::vector<double> volumes_of(const SeparatingSurface& surface) {
  std::vector<double> volumes = {0};
  for (const LabelMeasure& measure : label_measures(surface)) {
    volumes.push_back(measure.extent.volume_mm3);
  }
  return volumes;
}

// Grown by a hundredth, a part has 3 % more.
TEST(PartVolumes, ChangeAsMeasuredOtherwise) {
  const SeparatingSurface surface = cells(true);
  const PartVolumes volumes(surface.mesh, surface.sides.span());
  std::vector<Vec3> places(surface.mesh.positions.begin(), surface.mesh.positions.end());
  const auto numbers = consecutive<std::uint32_t>(0, surface.sides.size());
  const auto changes = [&] {
    return volumes.changes(places, surface.mesh.triangles.span(), numbers);
  };
  for (const double change : changes()) EXPECT_EQ(change, 0);
  for (Vec3& place : places) {
    for (float& x : place) x *= 1.01F;
  }
  const std::vector<double> found = changes();
  const std::vector<double> before = volumes_of(surface);
  ASSERT_EQ(found.size(), before.size());
  for (std::size_t part = 1; part < found.size(); ++part) {
    EXPECT_NEAR(found[part], (std::pow(1.01, 3) - 1) * before[part], 1e-4 * before[part]);
  }
  EXPECT_EQ(volumes.beyond(0.029, found), (std::vector<std::uint8_t>{0, 1, 1, 1}));
  EXPECT_EQ(volumes.beyond(0.031, found), (std::vector<std::uint8_t>{0, 0, 0, 0}));
}

// Its ends stay, so the change is that of the closed part, wherever the middle is.
TEST(PartVolumes, OfOpenPartsChangeAsThoseOfClosedOnes) {
  std::vector<std::vector<double>> changes;
  for (const bool close : {false, true}) {
    const SeparatingSurface surface = cells(close);
    const PartVolumes volumes(surface.mesh, surface.sides.span());
    std::vector<Vec3> places(surface.mesh.positions.begin(), surface.mesh.positions.end());
    for (Vec3& place : places) {
      const double deep = std::min({place[0] - 1, 18 - place[0], place[1] - 1, 16 - place[1],
                                    place[2] - 1, 14 - place[2], 2.0F});
      if (deep > 0) place[0] += static_cast<float>(0.1 * deep * std::sin(place[1]));
    }
    changes.push_back(volumes.changes(places, surface.mesh.triangles.span(),
                                      consecutive<std::uint32_t>(0, surface.sides.size())));
  }
  double largest = 0;
  for (std::size_t part = 1; part < changes[0].size(); ++part) {
    EXPECT_NEAR(changes[0][part], changes[1][part], 1e-3);
    largest = std::max(largest, std::abs(changes[0][part]));
  }
  EXPECT_GT(largest, 0.1);
}

// One vertex was drawn through the label, and another one moved out of it without a collapse.
TEST(PartVolumes, ComeBackWhereTheyWereLost) {
  auto volume = test::constant<std::uint8_t>(0, {14, 14, 14});
  for (std::uint32_t k = 4; k < 10; ++k) {
    for (std::uint32_t j = 4; j < 10; ++j) {
      for (std::uint32_t i = 4; i < 10; ++i) volume.at(i, j, k) = 1;
    }
  }
  const SeparatingSurface box = separated(volume, {.labels = {1}, .close = true});
  const PartVolumes volumes(box.mesh, box.sides.span());
  const auto vertex_at = [&](float x, float y) {
    const auto found = std::ranges::find_if(box.mesh.positions, [&](const Vec3& p) {
      return p[0] == x && p[1] == y && std::abs(p[2] - 7) < 1;
    });
    return static_cast<std::uint32_t>(found - box.mesh.positions.begin());
  };
  const std::uint32_t drawn = vertex_at(9.5F, 7);
  const std::uint32_t into = vertex_at(3.5F, 7);
  const std::uint32_t moved = vertex_at(3.5F, 5);
  ASSERT_LT(std::max({drawn, into, moved}), box.mesh.positions.size());
  std::vector<Vec3> places(box.mesh.positions.begin(), box.mesh.positions.end());
  places[moved][0] -= 0.5F;
  History history(places.size());
  history.add({drawn, into, 0});
  std::vector<Triangle> triangles;
  for (const Triangle& triangle : box.mesh.triangles) {
    triangles.push_back(history.corners_of(triangle));
  }
  const std::vector<double> changes =
      volumes.changes(places, triangles, consecutive<std::uint32_t>(0, box.sides.size()));
  EXPECT_LT(changes[1], -1);
  const std::vector<std::uint32_t> which =
      volumes.to_undo(1e-3, changes, box.mesh, history, places);
  EXPECT_FALSE(which.empty());
  for (const std::uint32_t t : which) {
    EXPECT_TRUE(std::ranges::find(box.mesh.triangles[t], drawn) != box.mesh.triangles[t].end());
  }
  EXPECT_TRUE(volumes.to_undo(0.5, changes, box.mesh, history, places).empty());
}

// A block that fills the volume. A triangle between three faces is none of a cap.
TEST(Caps, AreThePlanesThatTheSurfaceEndsIn) {
  const SeparatingSurface block =
      separated(test::constant<std::uint8_t>(1, {8, 8, 8}), {.labels = {1}, .close = true});
  const std::vector<Triangle> across = {[&] {
    Triangle corners = {};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto found = std::ranges::find_if(block.mesh.positions, [&](const Vec3& p) {
        return p[axis] == 7.5F && p[(axis + 1) % 3] == 3 && p[(axis + 2) % 3] == 3;
      });
      corners[axis] = static_cast<std::uint32_t>(found - block.mesh.positions.begin());
    }
    return corners;
  }()};
  ASSERT_LT(std::ranges::max(across[0]), block.mesh.positions.size());
  const Caps none(block.mesh, across);
  EXPECT_EQ(none.share_of_way({4, 4, 4}, {3, 3, 3}), 1);
  const Caps caps(block.mesh, block.mesh.triangles.span());
  EXPECT_NEAR(caps.share_of_way({6, 4, 4}, {3, 0, 0}), 0.25, 1e-6);  // half-way to 7.5
  EXPECT_EQ(caps.share_of_way({6, 4, 4}, {0.5, 0, 0}), 1);
  EXPECT_EQ(caps.share_of_way({6, 4, 4}, {-3, 0, 0}), 1);
}

// Positions far from the origin are rounded, so small triangles hardly tell their plane.
TEST(Caps, AreFoundWhereverTheSurfaceLies) {
  SeparatingSurface block =
      separated(test::constant<std::uint8_t>(1, {60, 50, 40}), {.labels = {1}, .close = true});
  const auto turned = [](const Point& p) {
    const double x = 0.8 * p[0] - 0.6 * p[1];
    const double y = 0.6 * p[0] + 0.8 * p[1];
    return Point{x, 0.96 * y - 0.28 * p[2], 0.28 * y + 0.96 * p[2]};
  };
  const Point away = {700, -900, 1100};
  for (Vec3& place : block.mesh.positions) {
    place = rounded(plus(turned(to_point(place)), away));
  }
  const Caps caps(block.mesh, block.mesh.triangles.span());
  const Point place = plus(turned({30, 25, 20}), away);
  const std::array<Point, 6> ways = {
      {{118, 0, 0}, {-122, 0, 0}, {0, 98, 0}, {0, -102, 0}, {0, 0, 78}, {0, 0, -82}}};
  for (const Point& way : ways) {
    EXPECT_NEAR(caps.share_of_way(place, turned(way)), 0.125, 1e-4)
        << way[0] << " " << way[1] << " " << way[2];
  }
}

TEST(Caps, AreNoneOfAnOpenSurface) {
  const SeparatingSurface surface = cells(false);
  const Caps caps(surface.mesh, surface.mesh.triangles.span());
  EXPECT_EQ(caps.share_of_way({10, 10, 10}, {100, 0, 0}), 1);
}

}  // namespace
}  // namespace isomesh::mesh::collapse
