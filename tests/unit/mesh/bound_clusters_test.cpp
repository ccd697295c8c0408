#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/collapse/clusters.h"
#include "server/mesh/collapse/field.h"
#include "server/mesh/collapse/vec.h"
#include "tests/support/kernels.h"
#include "tests/support/shapes.h"

namespace isomesh::mesh::collapse {
namespace {

// Positions of a regularised surface's vertices: one per cluster, the mean of its crossings, then
// all crossings without a cluster.
std::vector<Vecd> vertices_of(const Field& field, const std::vector<Crossing>& crossings,
                              const Clusters& clusters) {
  std::vector<Vecd> places;
  std::vector<int> owners(crossings.size(), 0);
  for (std::size_t k = 0; k < clusters.size(); ++k) {
    const auto members = clusters.members(k);
    EXPECT_FALSE(members.empty());
    EXPECT_TRUE(std::ranges::is_sorted(members));
    Vecd sum;
    for (const std::uint32_t v : members) {
      ++owners[v];
      sum = sum + zero_between(field, crossings[v]);
    }
    places.push_back(sum * (1 / static_cast<double>(members.size())));
  }
  EXPECT_LE(std::ranges::max(owners), 1);  // no crossing is in two
  for (std::size_t v = 0; v < crossings.size(); ++v) {
    if (owners[v] == 0) places.push_back(zero_between(field, crossings[v]));
  }
  return places;
}

template <class T>
void expect_the_regularised_by_scheme(const test::SampleVolume<T>& volume,
                                      const ExtractOptions& plain) {
  const auto field = make_field(volume.lattice(), plain, plain.close ? 3 : 0, {});
  ASSERT_TRUE(field);
  const Crossings crossings = crossings_of(*field, {});
  const Clusters clusters = find_clusters(volume.lattice(), plain, *field, crossings, {});
  EXPECT_GT(clusters.size(), 0U);
  const std::vector<Vecd> places = vertices_of(*field, crossings.all, clusters);
  ExtractOptions joining = plain;
  joining.regularize = true;
  const Mesh mesh = test::extracted(volume, joining);
  ASSERT_EQ(places.size(), mesh.positions.size());
  const Metric metric(volume.lattice().to_space);
  for (const Vecd& place : places) {
    const Vecd at = metric.place(place);
    EXPECT_TRUE(std::ranges::any_of(mesh.positions, [&](const Vec3& p) {
      return std::hypot(p[0] - at.x, p[1] - at.y, p[2] - at.z) < 1e-3;
    }));
  }
}

template <class T>
void expect_the_regularised(const test::SampleVolume<T>& volume, ExtractOptions plain) {
  for (const Scheme scheme : test::kSchemes) {
    SCOPED_TRACE(static_cast<int>(scheme));
    plain.scheme = scheme;
    expect_the_regularised_by_scheme(volume, plain);
  }
}

TEST(BoundClustersTest, AreThoseOfTheRegularisedSurface) {
  expect_the_regularised(test::sample<float>(test::gyroid(7), {14, 12, 13}), {});
  expect_the_regularised(test::noise_between<float>(-1, 1, {9, 8, 10}, 3), {.iso = 0.01});
  const auto equal = test::noise<std::uint8_t>({0, 1, 2, 3}, {8, 9, 7}, 5);
  expect_the_regularised(equal, {.iso = 2});  // many samples equal to the iso-value
  expect_the_regularised(equal, {.iso = 1.5, .interpolation = Interpolation::kMidpoint});
}

template <class T>
void expect_the_vertices(const test::SampleVolume<T>& volume, ExtractOptions options) {
  for (const Scheme scheme : test::kSchemes) {
    SCOPED_TRACE(static_cast<int>(scheme));
    options.scheme = scheme;
    const std::uint32_t margin = options.close ? 2 : 0;
    const auto field = make_field(volume.lattice(), options, margin, {});
    ASSERT_TRUE(field);
    const std::vector<Crossing> crossings = crossings_of(*field, {}).all;
    const Mesh mesh = test::extracted(volume, options);
    ASSERT_EQ(crossings.size(), mesh.positions.size());
    const Metric metric = Metric(volume.lattice().to_space).before(margin);
    for (std::size_t v = 0; v < crossings.size(); ++v) {
      EXPECT_GT(field->values[crossings[v].inside], 0);
      EXPECT_LT(field->values[crossings[v].outside], 0);
      if (mesh.is_on_border(v)) continue;  // those of caps give way, along their faces
      const Vecd at = metric.place(zero_between(*field, crossings[v]));
      const Vec3& p = mesh.positions[v];
      EXPECT_LT(std::hypot(p[0] - at.x, p[1] - at.y, p[2] - at.z), 1e-3) << v;
    }
  }
}

TEST(BoundCrossingsTest, AreTheVerticesInTheirOrder) {
  for (const bool close : {false, true}) {
    expect_the_vertices(test::sample<float>(test::gyroid(7), {14, 12, 13}), {.close = close});
    expect_the_vertices(test::noise_between<float>(-1, 1, {9, 8, 10}, 3),
                        {.iso = 0.01, .close = close});
    const auto equal = test::noise<std::uint8_t>({0, 1, 2, 3}, {8, 9, 7}, 5);
    expect_the_vertices(equal, {.iso = 2, .close = close});
    expect_the_vertices(equal,
                        {.iso = 1.5, .interpolation = Interpolation::kMidpoint, .close = close});
    expect_the_vertices(test::noise<std::uint8_t>({0, 1}, {2, 2, 2}, 5),
                        {.iso = 0.5, .close = close});
  }
}

}  // namespace
}  // namespace isomesh::mesh::collapse
