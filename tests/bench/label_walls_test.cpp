// Tests of the counts of gaps and overlaps, and of the peers for labels.
#include "tests/bench/label_walls.h"

#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "tests/bench/label_body.h"
#include "tests/bench/label_stages.h"
#include "tests/bench/peers.h"
#include "tests/bench/surface_nets.h"
#include "tests/support/files.h"

namespace isomesh::bench {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// The tetrahedron between a corner and the points at `edge` from it along each axis, wound outward.
void add_tetrahedron(const mesh::Vec3& corner, float edge, std::uint16_t number, Walls& walls) {
  const auto first = static_cast<std::uint32_t>(walls.positions.size());
  walls.positions.push_back(corner);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    walls.positions.push_back(corner);
    walls.positions.back()[axis] += edge;
  }
  for (const mesh::Triangle& corners : {mesh::Triangle{0, 2, 1}, {0, 3, 2}, {0, 1, 3}, {1, 2, 3}}) {
    walls.triangles.push_back({first + corners[0], first + corners[1], first + corners[2]});
    walls.sides.push_back({0, number});
  }
}

TEST(Sharing, CountsGapsAndOverlaps) {
  Walls walls;
  add_tetrahedron({0, 0, 0}, 6, 1, walls);
  add_tetrahedron({1, 1, 1}, 6, 2, walls);
  const std::vector<Probe> probes = {
      {{0.5, 0.5, 0.5}, true},                          // in the first
      {{3.1, 2.2, 2.3}, true},                          // in the second
      {{1.1, 1.2, 1.3}, true},                          // in both
      {{1.1, 1.2, 1.4}, false}, {{9, 1.2, 1.3}, true},  // in none, beyond them
      {{-1, 1.2, 1.3}, true},  // in none, before them: the ray crosses both
      {{-1, 1.2, 1.4}, false},  {{1, 40, -40}, true}};  // beside all columns
  const Sharing sharing = measure_sharing(walls, probes);
  EXPECT_EQ(sharing.points, 8U);
  EXPECT_EQ(sharing.points_within_labels, 6U);
  EXPECT_EQ(sharing.gaps, 3U);
  EXPECT_EQ(sharing.overlaps, 2U);
  EXPECT_THAT(enclosed_volumes(walls, 2), ElementsAre(36, 36));
}

// 6 x 4 x 4 samples of 2 mm, halves of the labels 7 and 9, in a background.
Samples two_blocks() {
  Samples samples;
  samples.dims = {6, 4, 4};
  samples.geometry.spacing = {2, 2, 2};
  samples.geometry.origin = {10, 20, 30};
  for (std::size_t i = 0; i < samples.dims.samples(); ++i) {
    samples.bytes.push_back(std::byte{static_cast<std::uint8_t>(i % 6 < 3 ? 7 : 9)});
  }
  return padded(samples);
}

// Without clusters, so that both blocks have the same walls and nearly the volume of their voxels
// before they are smoothed.
MeshParameters plain() {
  MeshParameters parameters = label_parameters({});
  parameters.regularize = false;
  return parameters;
}

TEST(Sharing, OfASharedWallHasNoGapUntilItIsTorn) {
  const Samples samples = two_blocks();
  LabelStages stages(samples, plain());
  EXPECT_THAT(stages.labels(), ElementsAre(7, 9));
  stages.extract();
  Walls walls = stages.walls();
  const auto probes = probes_near_walls(samples, stages.labels(), 2000);
  Sharing sharing = measure_sharing(walls, probes);
  EXPECT_GT(sharing.points_within_labels, 0U);
  EXPECT_EQ(sharing.gaps, 0U);
  EXPECT_EQ(sharing.overlaps, 0U);

  const std::vector<double> volumes = enclosed_volumes(walls, 2);
  EXPECT_NEAR(volumes[0], volumes[1], 1e-3);
  EXPECT_LT(volumes[0], stages.voxels()[0].volume_mm3);
  EXPECT_GT(volumes[0], 0.8 * stages.voxels()[0].volume_mm3);

  // Each label gets a copy of the wall, and the second is moved away, then into the first.
  const std::vector<mesh::Vec3> whole = walls.positions;
  const Walls shared = walls;
  for (const float shift : {0.4F, -0.4F}) {
    walls = {};
    for (const std::uint16_t number : {std::uint16_t{1}, std::uint16_t{2}}) {
      const auto first = static_cast<std::uint32_t>(walls.positions.size());
      for (mesh::Vec3 position : whole) {
        position[0] += number == 2 ? shift : 0;
        walls.positions.push_back(position);
      }
      for (std::size_t t = 0; t < shared.triangles.size(); ++t) {
        const mesh::WallSides sides = shared.sides[t];
        if (sides.front != number && sides.back != number) continue;
        const auto& [a, b, c] = shared.triangles[t];
        walls.triangles.push_back({first + a, first + b, first + c});
        walls.sides.push_back(sides.front == number ? mesh::WallSides{number, 0}
                                                    : mesh::WallSides{0, number});
      }
    }
    sharing = measure_sharing(walls, probes);
    EXPECT_EQ(sharing.gaps > 0, shift > 0);
    EXPECT_EQ(sharing.overlaps > 0, shift < 0);
    EXPECT_NEAR(enclosed_volumes(walls, 2)[1], volumes[1], 1e-2);
  }
}

double plain_triangles(const Samples& samples) {
  LabelStages stages(samples, plain());
  stages.extract();
  return static_cast<double>(stages.size().triangles);
}

TEST(Sharing, OfWallsWithoutStairsHasNoGap) {
  const Samples samples = two_blocks();
  LabelStages stages(samples);
  stages.extract();
  EXPECT_LT(stages.size().triangles, 0.6 * plain_triangles(samples));
  stages.remove_stairs();
  const Walls walls = stages.walls();
  const auto probes = probes_near_walls(samples, stages.labels(), 2000);
  const Sharing sharing = measure_sharing(walls, probes);
  EXPECT_GT(sharing.points_within_labels, 0U);
  EXPECT_EQ(sharing.gaps, 0U);
  EXPECT_EQ(sharing.overlaps, 0U);
  const std::vector<double> volumes = enclosed_volumes(walls, 2);
  for (std::size_t l = 0; l < 2; ++l) {
    const double voxels = stages.voxels()[l].volume_mm3;
    EXPECT_NEAR(volumes[l], voxels, 0.05 * voxels);
  }
}

TEST(Probes, LieInCellsOfTwoLabels) {
  const Samples samples = two_blocks();
  const std::vector<std::int64_t> labels = {7, 9};
  const auto probes = probes_near_walls(samples, labels, 500);
  ASSERT_EQ(probes.size(), 500U);
  for (const Probe& probe : probes) {
    const bool is_at_wall = probe.at[0] > 14 && probe.at[0] < 16;
    const bool is_at_border = probe.at[0] < 10 || probe.at[0] > 20 || probe.at[1] < 20 ||
                              probe.at[1] > 26 || probe.at[2] < 30 || probe.at[2] > 36;
    EXPECT_TRUE(is_at_wall || is_at_border);
    if (probe.is_within_labels) {
      EXPECT_TRUE(is_at_wall);
      EXPECT_TRUE(probe.at[1] > 22 && probe.at[1] < 24 && probe.at[2] > 32 && probe.at[2] < 34);
    }
  }
  EXPECT_THROW(probes_near_walls(samples, {}, 10), std::runtime_error);
}

TEST(Peers, LabelsOfFlyingEdgesAreClosedAndWoundOutward) {
  if (!peers_available()) GTEST_SKIP() << peers_description();
  const Samples samples = two_blocks();
  LabelStages stages(samples, plain());
  stages.extract();
  const auto ours = enclosed_volumes(stages.walls(), 2);
  Peers peers(samples, 0);
  peers.discrete_flying_edges(stages.labels());
  const auto theirs = enclosed_volumes(peers.label_walls(), 2);
  for (std::size_t l = 0; l < 2; ++l) EXPECT_NEAR(theirs[l], ours[l], 0.1 * ours[l]);
  const auto probes = probes_near_walls(samples, stages.labels(), 2000);
  EXPECT_EQ(measure_sharing(peers.label_walls(), probes).gaps, 0U);
  peers.smooth_labels();
  EXPECT_GT(measure_sharing(peers.label_walls(), probes).gaps, 0U);
}

TEST(SurfaceNets, SaysWhatARootLacks) {
  const test::TemporaryFolder root;
  const Samples samples = two_blocks();
  const auto reason = [&] {
    try {
      SurfaceNets(root.path(), samples, {7, 9}, 1);
    } catch (const std::runtime_error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(reason(), HasSubstr("holds no Debian"));
  const auto libraries = root / "usr/lib/any-linux-gnu";
  std::filesystem::create_directories(libraries);
  test::write_file(libraries / "ld-linux.so", "");
  EXPECT_THAT(reason(), HasSubstr("no package python3-vtk9"));
}

TEST(SurfaceNets, SharesOutSpace) {
  const char* root = std::getenv("ISOMESH_SURFACE_NETS_ROOT");
  if (root == nullptr) GTEST_SKIP() << kNoSurfaceNets;
  const Samples samples = two_blocks();
  SurfaceNets nets(root, samples, {7, 9}, 1);
  EXPECT_GT(nets.run_ms(), 0);
  EXPECT_THAT(nets.description(), HasSubstr("TBB"));
  const Walls walls = nets.walls();
  ASSERT_FALSE(walls.triangles.empty());
  ASSERT_EQ(walls.sides.size(), walls.triangles.size());
  const Sharing sharing =
      measure_sharing(walls, probes_near_walls(samples, {std::vector<std::int64_t>{7, 9}}, 2000));
  EXPECT_EQ(sharing.gaps, 0U);
  EXPECT_EQ(sharing.overlaps, 0U);
}

}  // namespace
}  // namespace isomesh::bench
