#include "server/mesh/labels/label_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/measure/normals.h"
#include "server/mesh/smooth/smooth.h"
#include "server/mesh/stairs/stairs.h"
#include "tests/support/any_threads.h"
#include "tests/support/errors.h"
#include "tests/support/nifti.h"
#include "tests/unit/mesh/separated.h"

namespace isomesh::mesh {
namespace {

using test::SampleVolume;

TEST(LabelSurface, IsSoundAndClosedWhateverTheLabelsAre) {
  for (std::size_t count = 2; count < 10; ++count) {
    const auto volume = label_noise(count, {9, 8, 7}, 90 + count, test::oblique_geometry());
    for (const SeparateOptions& options :
         all_separations(consecutive<std::int64_t>(1, count - 1))) {
      SCOPED_TRACE(describe(volume.dims, options));
      const SeparatingSurface surface = separated(volume, options);
      for (std::size_t number = 1; number < count; ++number) {
        const Mesh mesh = label_mesh(surface, number);
        test::expect_layers(mesh);
        const test::Surface own = test::surface_of(mesh);
        ASSERT_TRUE(test::is_sound(own));
        if (options.close) {
          ASSERT_TRUE(test::topology_of(own).boundary_edges.empty());
          ASSERT_GT(test::extent_of(own).volume, 0);
        } else {
          ASSERT_TRUE(test::boundary_is_on_border(own, volume.dims, volume.lattice().to_space));
        }
      }
    }
  }
}

using WallAreas = std::map<std::pair<std::size_t, std::size_t>, double>;

WallAreas walls_between(const SeparatingSurface& surface) {
  WallAreas areas;
  for (const WallArea& wall : measure_walls(surface, {}, {}))
    areas[{wall.a, wall.b}] = wall.area_mm2;
  return areas;
}

TEST(LabelWalls, OfTwoBoxesAreTheFacesThatTheyShare) {
  auto volume = test::constant<std::uint8_t>(0, {16, 14, 10});
  volume.geometry.spacing = {0.5, 1, 2};
  for (std::uint32_t z = 0; z < 10; ++z) {
    for (std::uint32_t y = 2; y < 12; ++y) {
      for (std::uint32_t x = 2; x < 14; ++x) volume.at(x, y, z) = x < 8 ? 3 : 5;
    }
  }
  const SeparatingSurface surface = separated(volume, {.labels = {3, 5}, .close = true});
  WallAreas areas = walls_between(surface);
  ASSERT_EQ(areas.size(), 3U);
  // Edges are bevelled, within half a sample of them.
  const double shared = areas[std::pair(1, 2)];
  EXPECT_LE(shared, 10.0 * 20);
  EXPECT_GE(shared, 9.0 * 18);
  // Five faces of each box.
  const double other = areas[std::pair(1, 0)];
  EXPECT_NEAR(other, (areas[{2, 0}]), 0.01);
  EXPECT_LE(other, 10 * 20 + 2 * (3 * 20 + 3 * 10));
  EXPECT_GE(other, 9 * 18 + 2 * (2.5 * 18 + 2.5 * 9));
}

TEST(LabelWalls, OfABallThatAPlaneCutsAreADiscAndTwoHalves) {
  constexpr double kRadius = 11.3;
  auto volume = test::constant<std::uint8_t>(0, {28, 28, 28});
  for (std::uint32_t z = 0; z < 28; ++z) {
    for (std::uint32_t y = 0; y < 28; ++y) {
      for (std::uint32_t x = 0; x < 28; ++x) {
        if (std::hypot(x - 13.5, y - 13.5, z - 13.5) < kRadius) volume.at(x, y, z) = x < 14 ? 1 : 2;
      }
    }
  }
  // The plane is one of the lattice; around the disc, where three labels meet, walls are bevelled.
  const double disc = std::numbers::pi * kRadius * kRadius;
  WallAreas areas = walls_between(separated(volume, {.labels = {1, 2}}));
  ASSERT_EQ(areas.size(), 3U);
  EXPECT_NEAR((areas[{1, 2}]), disc, 0.08 * disc);

  const SeparateOptions options = {.labels = {1, 2}, .regularize = true};
  const Lattice<std::uint8_t> lattice = volume.lattice();
  const SurfaceCount count = count_walls(lattice, options, {});
  SeparatingSurface surface;
  extract_walls(lattice, options, count, {}, surface);
  remove_stairs(lattice, options, 10, {}, surface);
  areas = walls_between(surface);
  EXPECT_NEAR((areas[{1, 0}]), 2 * disc, 0.03 * 2 * disc);
  EXPECT_NEAR((areas[{2, 0}]), 2 * disc, 0.03 * 2 * disc);
}

TEST(LabelWalls, AddUpToEachLabelsAreaOnAnyNumberOfThreads) {
  const SeparatingSurface surface =
      separated(label_noise(5, {9, 8, 7}, 3), {.labels = {1, 2, 3, 4}, .close = true});
  const WallAreas areas = walls_between(surface);
  const auto measures = label_measures(surface);
  double all = 0;
  std::vector<double> own(5, 0);
  for (const auto& [sides, area] : areas) {
    all += area;
    own[sides.first] += area;
    if (sides.second != 0) {
      EXPECT_LT(sides.first, sides.second);
      own[sides.second] += area;
    }
  }
  for (std::size_t n = 0; n < 4; ++n) EXPECT_NEAR(own[n + 1], measures[n].extent.area_mm2, 1e-3);
  EXPECT_NEAR(all, measure_extent(surface.mesh, {}).area_mm2, 1e-3);
  test::expect_same_on_any_threads([&] { return walls_between(surface); });
}

// 1: samples 10 and 11. 2: 11 and 12. So the wall of 10 and 11 is 2's alone, that of 11 and 12 1's.
TEST(LabelWalls, OfLabelsThatOverlapAreBetweenThoseThatEnd) {
  auto volume = test::constant<std::uint8_t>(0, {12, 8, 8});
  for (std::uint32_t z = 1; z < 7; ++z) {
    for (std::uint32_t y = 1; y < 7; ++y) {
      for (std::uint32_t x = 1; x < 10; ++x) {
        volume.at(x, y, z) = static_cast<std::uint8_t>(10 + (x - 1) / 3);
      }
    }
  }
  WallAreas areas = walls_between(
      separated(volume, {.labels = {1, 2}, .values = {{1, {10, 11}}, {2, {11, 12}}}}));
  EXPECT_EQ(areas.size(), 2U);  // they touch nowhere: both end only beside the background
  EXPECT_NEAR((areas[{1, 0}]), (areas[{2, 0}]), 1e-3);
  for (auto& value : volume.samples) value = value == 11 ? 12 : value;
  areas = walls_between(
      separated(volume, {.labels = {1, 2}, .values = {{1, {10, 11}}, {2, {11, 12}}}}));
  EXPECT_GT((areas[{1, 2}]), 25);
}

// Two boxes side by side: the mean normal along the edge of their wall would lean to the neighbour.
TEST(LabelSurface, IsShadedByItsOutsideWhereAWallBegins) {
  auto volume = test::constant<std::uint8_t>(0, {14, 12, 12});
  for (std::uint32_t z = 2; z < 10; ++z) {
    for (std::uint32_t y = 2; y < 10; ++y) {
      for (std::uint32_t x = 2; x < 12; ++x) volume.at(x, y, z) = x < 7 ? 1 : 2;
    }
  }
  for (const SeparateOptions& options : all_separations(consecutive<std::int64_t>(1, 2))) {
    SCOPED_TRACE(describe(volume.dims, options));
    const SeparatingSurface surface = separated(volume, options);
    const LabelSurface label = std::move(label_surfaces(surface, {})[0]);
    const Mesh& mesh = label.mesh;
    Buffer<Vec3> means;
    vertex_normals(mesh, {}, means);
    const Buffer<Vec3> normals = shading_of(label, surface, {});
    ASSERT_EQ(normals.size(), mesh.positions.size());
    double shaded = 0;
    double mean = 0;
    std::size_t on_edge = 0;
    std::size_t on_wall = 0;
    for (std::size_t v = 0; v < normals.size(); ++v) {
      const Vec3& p = mesh.positions[v];
      if (p[0] < 6.2F || p[2] < 4 || p[2] > 8) continue;
      if (p[1] > 9.2F) {
        ++on_edge;
        shaded += normals[v][1];
        mean += means[v][1];
      } else if (p[1] > 4 && p[1] < 8) {
        ++on_wall;
        EXPECT_GT(normals[v][0], 0.99F);
      }
    }
    ASSERT_GT(on_edge, 2U);
    EXPECT_GT(on_wall, 8U);
    EXPECT_GT(shaded / static_cast<double>(on_edge), 0.8);
    EXPECT_GT(shaded - mean, 0.05 * static_cast<double>(on_edge));
  }
}

TEST(LabelSurface, HasTheTrianglesThatWereCounted) {
  auto volume = label_cells(9, {70, 21, 30}, 12, 89);
  for (std::size_t i = 0; i < volume.samples.size(); i += 11) volume.samples[i] = i % 9;
  for (const SeparateOptions& options : all_separations(consecutive<std::int64_t>(1, 9))) {
    SCOPED_TRACE(describe(volume.dims, options));
    const SeparatingSurface surface = separated(volume, options);
    const auto own = label_surfaces(surface, {});
    const auto counts = counted_triangles(volume.lattice(), options);
    ASSERT_EQ(counts.size(), 10U);
    for (std::size_t n = 1; n < counts.size(); ++n)
      EXPECT_EQ(counts[n], own[n - 1].triangles.size());
  }
}

TEST(LabelSurface, OfOneLabelIsAll) {
  const auto volume = label_noise(2, {20, 9, 12}, 91);
  for (const SeparateOptions& options : all_separations({1})) {
    const SeparatingSurface surface = separated(volume, options);
    EXPECT_TRUE(test::same_bytes(label_mesh(surface, 1), surface.mesh));
  }
}

TEST(LabelSurface, OfALabelThatNoSampleHasIsEmpty) {
  const SeparatingSurface surface = separated(label_noise(2, {9, 9, 9}, 92), {{1, 7}});
  const Mesh mesh = label_mesh(surface, 2);
  EXPECT_EQ(mesh.positions.size(), 0U);
  EXPECT_EQ(mesh.triangles.size(), 0U);
  EXPECT_EQ(mesh.layers(), surface.mesh.layers());
}

// Without a background the labels fill the box of the voxels, but for what is cut off along its
// edges: an eighth of a voxel at most for each.
TEST(LabelVolumes, FillTheBoxOfTheVoxels) {
  constexpr double kVoxels = 11.0 * 9 * 8;
  constexpr double kVoxelsAlongEdges = 4 * (11 + 9 + 8);
  for (const auto& [name, geometry] : test::all_geometries()) {
    SCOPED_TRACE(name);
    const auto volume = label_noise(6, {11, 9, 8}, 93, geometry);
    const double voxel = std::abs(volume.lattice().to_space.determinant());
    for (const Scheme scheme : {Scheme::kFive, Scheme::kSix}) {
      const auto labels = select_labels(count_labels(volume.lattice(), {}), 99);
      const SeparatingSurface surface = separated(volume, {labels, scheme, true});
      double sum = 0;
      for (const LabelMeasure& label : label_measures(surface)) {
        EXPECT_TRUE(label.is_closed());
        sum += label.extent.volume_mm3;
      }
      EXPECT_LE(sum, kVoxels * voxel * (1 + 1e-4));
      EXPECT_GE(sum, (kVoxels - kVoxelsAlongEdges / 8) * voxel);
    }
  }
}

// The background is in front of the union of all labels.
double volume_of_union(const SeparatingSurface& surface) {
  test::Surface outer;
  for (const Vec3& p : surface.mesh.positions) outer.points.push_back({p[0], p[1], p[2]});
  for (std::size_t t = 0; t < surface.sides.size(); ++t) {
    if (surface.sides[t].front == 0) outer.triangles.push_back(surface.mesh.triangles[t]);
  }
  return test::extent_of(outer).volume;
}

TEST(LabelVolumes, AreThatOfTheirUnionAndAboutThatOfTheVoxels) {
  const auto volume = label_cells(9, {48, 44, 40}, 14, 94);
  const auto present = count_labels(volume.lattice(), {});
  const auto labels = select_labels(present, 0);
  for (const Scheme scheme : {Scheme::kFive, Scheme::kSix}) {
    SeparatingSurface surface = separated(volume, {labels, scheme, true});
    for (const int passes : {0, 10}) {
      smooth({.steps = test::means(passes, {1}), .max_displacement_mm = 0.5}, {}, surface.mesh);
      const auto measures = label_measures(surface);
      double sum = 0;
      double voxels = 0;
      for (std::size_t n = 0; n < measures.size(); ++n) {
        sum += measures[n].extent.volume_mm3;
        voxels += present[n + 1].volume_mm3;
        ASSERT_EQ(measures[n].label, present[n + 1].label);
        EXPECT_NEAR(measures[n].extent.volume_mm3, present[n + 1].volume_mm3,
                    0.05 * present[n + 1].volume_mm3);
      }
      EXPECT_NEAR(sum, volume_of_union(surface), 1e-6 * sum);
      EXPECT_NEAR(sum, voxels, 0.02 * voxels);
    }
  }
}

TEST(LabelVolumes, OfAnAtlasAreThatOfItsVoxels) {
  const auto volume = test::read_nifti_samples(test::kAtlasFile);
  const auto present = count_labels(volume.lattice(), {});
  const auto labels = select_labels(present, 0);
  EXPECT_EQ(labels.size(), 116U);
  const SeparatingSurface surface = separated(volume, {labels});
  double sum = 0;
  for (const LabelMeasure& label : label_measures(surface)) {
    EXPECT_TRUE(label.is_closed());
    EXPECT_TRUE(label.topology.manifold);
    EXPECT_TRUE(label.topology.oriented);
    sum += label.extent.volume_mm3;
  }
  const double voxels = std::accumulate(
      present.begin() + 1, present.end(), 0.0,
      [](double total, const LabelVoxels& label) { return total + label.volume_mm3; });
  EXPECT_NEAR(sum, voxels, 0.001 * voxels);
}

TEST(MeasureLabels, SaysWhatEachSurfaceIs) {
  const auto volume = label_cells(9, {40, 21, 30}, 12, 95);
  for (const SeparateOptions& options : all_separations(consecutive<std::int64_t>(1, 9))) {
    const SeparatingSurface surface = separated(volume, options);
    const auto measures = label_measures(surface);
    ASSERT_EQ(measures.size(), 9U);
    for (std::size_t n = 0; n < measures.size(); ++n) {
      const Mesh mesh = label_mesh(surface, n + 1);
      const test::Surface own = test::surface_of(mesh);
      const test::TopologyFacts topology = test::topology_of(own);
      const test::ExtentFacts extent = test::extent_of(own, mesh.origin);
      const LabelMeasure& measure = measures[n];
      EXPECT_EQ(measure.label, static_cast<std::int64_t>(n + 1));
      EXPECT_EQ(measure.vertices, own.points.size());
      EXPECT_EQ(measure.triangles, own.triangles.size());
      EXPECT_EQ(measure.topology.components, topology.components);
      EXPECT_EQ(measure.topology.euler, topology.euler);
      EXPECT_EQ(measure.topology.boundary_edges, topology.boundary_edges.size());
      EXPECT_EQ(measure.is_closed(), topology.boundary_edges.empty());
      EXPECT_TRUE(measure.topology.manifold);
      EXPECT_TRUE(measure.topology.oriented);
      EXPECT_NEAR(measure.extent.area_mm2, extent.area, 1e-6 * extent.area);
      EXPECT_NEAR(measure.extent.volume_mm3, extent.volume, 1e-6 * std::abs(extent.volume));
    }
  }
}

TEST(MeasureLabels, IsTheSameForAnyNumberOfThreads) {
  const SeparatingSurface surface =
      separated(label_cells(9, {40, 21, 30}, 12, 96), {consecutive<std::int64_t>(1, 9)});
  test::expect_same_on_any_threads([&] {
    std::vector<double> result;
    for (const LabelMeasure& m : label_measures(surface)) {
      result.insert(result.end(), {m.extent.area_mm2, m.extent.volume_mm3, m.extent.low[0]});
    }
    return result;
  });
}

TEST(MeasureLabels, EndsWhenItIsCancelled) {
  const SeparatingSurface surface = separated(label_noise(4, {9, 9, 9}, 97), {{1, 2, 3}});
  std::stop_source source;
  source.request_stop();
  EXPECT_EQ(test::code_thrown_by([&] {
              measure_labels(surface, label_surfaces(surface, {}), {source.get_token(), {}});
            }),
            ErrorCode::kCancelled);
}

}  // namespace
}  // namespace isomesh::mesh
