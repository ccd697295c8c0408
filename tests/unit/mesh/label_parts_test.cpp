// Labels that are made of several values, and labels that overlap.
#include "server/mesh/labels/label_parts.h"

#include <algorithm>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/errors.h"
#include "tests/unit/mesh/separated.h"

namespace isomesh::mesh {
namespace {

using test::SampleVolume;
using Values = std::map<std::int64_t, std::vector<std::int64_t>>;

// Each sample's value replaced, 0 where it is not named.
SampleVolume<std::uint8_t> with_values(SampleVolume<std::uint8_t> volume,
                                       const std::map<std::uint8_t, std::uint8_t>& of) {
  for (std::uint8_t& sample : volume.samples) {
    const auto found = of.find(sample);
    sample = found == of.end() ? std::uint8_t{0} : found->second;
  }
  return volume;
}

std::set<std::array<Vec3, 3>> places_of(const Mesh& mesh) {
  std::set<std::array<Vec3, 3>> places;
  for (const Triangle& triangle : mesh.triangles) {
    std::array<Vec3, 3> corners;
    for (std::size_t c = 0; c < 3; ++c) corners[c] = mesh.positions[triangle[c]];
    std::rotate(corners.begin(), std::ranges::min_element(corners), corners.end());
    places.insert(corners);
  }
  return places;
}

TEST(LabelParts, ValuesOfOneLabelAreOne) {
  const auto volume = label_noise(6, {11, 8, 9}, 301);
  const auto joined = with_values(volume, {{1, 1}, {2, 1}, {3, 2}, {5, 2}});
  for (SeparateOptions options : all_separations({1, 2})) {
    SCOPED_TRACE(describe(volume.dims, options));
    const SeparatingSurface expected = separated(joined, options);
    options.values = {{1, {1, 2}}, {2, {3, 5}}};
    EXPECT_TRUE(same_bytes(separated(volume, options), expected));
  }
}

TEST(LabelParts, ALabelNeedNotHoldItsOwnValue) {
  const auto volume = label_noise(4, {9, 8, 7}, 302);
  const auto joined = with_values(volume, {{3, 1}});
  for (SeparateOptions options : all_separations({1})) {
    const SeparatingSurface expected = separated(joined, options);
    options.values = {{1, {3}}};
    EXPECT_TRUE(same_bytes(separated(volume, options), expected));
  }
}

// Value 4 belongs to both 1 and 2.
TEST(LabelParts, LabelsThatOverlapAreWholeAndClosed) {
  const auto volume = label_cells(5, {24, 20, 22}, 9, 303);
  for (SeparateOptions options : all_separations({1, 2, 3})) {
    SCOPED_TRACE(describe(volume.dims, options));
    options.values = {{1, {1, 4}}, {2, {2, 4, 5}}};
    const SeparatingSurface surface = separated(volume, options);
    const auto counts = counted_triangles(volume.lattice(), options);
    for (std::size_t n = 1; n <= 3; ++n) {
      const Mesh mesh = label_mesh(surface, n);
      EXPECT_EQ(counts[n], mesh.triangles.size());
      const test::Surface own = test::surface_of(mesh);
      EXPECT_TRUE(test::is_sound(own));
      if (options.close) {
        EXPECT_TRUE(test::topology_of(own).boundary_edges.empty());
      }
    }
  }
}

// An overlapping label keeps the surface that it has alone, except near a third label.
TEST(LabelParts, AnOverlapLeavesTheSurfaceWhereItWas) {
  auto volume = test::constant<std::uint8_t>(0, {12, 9, 9});
  for (std::uint32_t k = 2; k < 7; ++k) {
    for (std::uint32_t j = 2; j < 7; ++j) {
      for (std::uint32_t i = 2; i < 10; ++i) volume.at(i, j, k) = i < 5 ? 1 : i < 7 ? 3 : 2;
    }
  }
  SeparateOptions options = {{1, 2}};
  options.values = {{1, {1, 3}}, {2, {2, 3}}};
  const SeparatingSurface surface = separated(volume, options);
  const auto first = places_of(label_mesh(surface, 1));
  const auto second = places_of(label_mesh(surface, 2));
  const auto alone = with_values(volume, {{1, 1}, {3, 1}});
  const auto expected = places_of(separated(alone, {{1}}).mesh);
  std::size_t same = 0;
  for (const auto& triangle : expected) same += first.count(triangle);
  // All but those around the edges of the overlap.
  EXPECT_GT(same, expected.size() * 6 / 10);
  EXPECT_LT(same, expected.size());
  EXPECT_GT(first.size(), expected.size());
  EXPECT_FALSE(std::ranges::equal(first, second));
}

TEST(LabelParts, RefusesMoreCombinationsThanItCanNumber) {
  std::vector<std::int64_t> labels;
  Values values;
  for (std::int64_t label = 1; label <= 17; ++label) {
    labels.push_back(label);
    for (std::int64_t value = 1; value < 1 << 17; ++value) {
      if ((value >> (label - 1) & 1) != 0) values[label].push_back(value);
    }
  }
  const auto error = test::thrown_by([&] { const LabelParts parts(labels, values); });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), ErrorCode::kUnusableVolume);
}

TEST(LabelParts, LabelsAreCountedWithAllTheirValues) {
  const auto volume = label_noise(6, {7, 6, 5}, 304);
  const auto counted = count_labels(volume.lattice(), {});
  const Values values = {{1, {1, 4}}, {2, {2, 4}}, {9, {7}}};
  const auto labels = labels_of(counted, 0, values);
  std::vector<std::int64_t> names;
  for (const LabelVoxels& label : labels) names.push_back(label.label);
  EXPECT_EQ(names, (std::vector<std::int64_t>{1, 2, 3, 5}));
  EXPECT_EQ(labels[0].voxels, counted[1].voxels + counted[4].voxels);
  EXPECT_EQ(labels[1].voxels, counted[2].voxels + counted[4].voxels);
  EXPECT_EQ(labels[2].voxels, counted[3].voxels);
}

}  // namespace
}  // namespace isomesh::mesh
