#include "server/mesh/topology/components.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/extract/extract.h"
#include "tests/support/any_threads.h"
#include "tests/support/errors.h"
#include "tests/support/kernels.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"

namespace isomesh::mesh {
namespace {

// Specks of all sizes over many slabs.
Mesh specks(bool close = false) {
  return test::extracted(test::noise<std::uint8_t>({0, 0, 0, 0, 0, 9}, {19, 17, 70}, 5),
                         {5, Scheme::kSix, Interpolation::kLinear, close});
}

// The smallest vertex that is connected with each, found the slow way.
std::vector<std::uint32_t> first_of(const Mesh& mesh) {
  std::vector<std::uint32_t> first(mesh.positions.size());
  std::iota(first.begin(), first.end(), 0U);
  for (bool changed = true; changed;) {
    changed = false;
    for (const Triangle& triangle : mesh.triangles) {
      const std::uint32_t least =
          std::min({first[triangle[0]], first[triangle[1]], first[triangle[2]]});
      for (const std::uint32_t vertex : triangle) {
        changed = changed || first[vertex] != least;
        first[vertex] = least;
      }
    }
  }
  return first;
}

struct Part {
  std::uint32_t first = 0;
  std::uint64_t triangles = 0;
};

// The largest first, of equal ones that of the smaller vertex.
std::vector<Part> parts_of(const Mesh& mesh) {
  const std::vector<std::uint32_t> first = first_of(mesh);
  std::map<std::uint32_t, std::uint64_t> sizes;
  for (const Triangle& triangle : mesh.triangles) ++sizes[first[triangle[0]]];
  std::vector<Part> parts;
  for (const auto& [vertex, triangles] : sizes) parts.push_back({vertex, triangles});
  std::ranges::stable_sort(parts, std::greater(), &Part::triangles);
  return parts;
}

// `mesh` without the parts that do not begin at one of these vertices, made anew.
Mesh only(const Mesh& mesh, const std::vector<Part>& parts) {
  const std::vector<std::uint32_t> first = first_of(mesh);
  const auto stays = [&](std::uint32_t vertex) {
    return std::ranges::find(parts, first[vertex], &Part::first) != parts.end();
  };
  Mesh result;
  result.origin = mesh.origin;
  std::vector<std::uint32_t> numbers(mesh.positions.size());
  std::vector<Vec3> positions;
  std::vector<Triangle> triangles;
  result.layer_vertices = {0};
  result.layer_triangles = {0};
  for (std::size_t layer = 0; layer < mesh.layers(); ++layer) {
    for (std::size_t v = mesh.layer_vertices[layer]; v < mesh.layer_vertices[layer + 1]; ++v) {
      if (!stays(static_cast<std::uint32_t>(v))) continue;
      numbers[v] = static_cast<std::uint32_t>(positions.size());
      positions.push_back(mesh.positions[v]);
      if (mesh.on_border.empty()) continue;
      result.on_border.resize(numbers[v] / kFlagBits + 1);
      result.on_border[numbers[v] / kFlagBits] |= std::uint64_t{mesh.is_on_border(v)}
                                                  << (numbers[v] % kFlagBits);
    }
    result.layer_vertices.push_back(positions.size());
  }
  for (std::size_t layer = 0; layer < mesh.layers(); ++layer) {
    for (std::size_t t = mesh.layer_triangles[layer]; t < mesh.layer_triangles[layer + 1]; ++t) {
      if (stays(mesh.triangles[t][0])) triangles.push_back(mesh.triangles[t]);
    }
    result.layer_triangles.push_back(triangles.size());
  }
  for (Triangle& triangle : triangles) {
    for (std::uint32_t& vertex : triangle) vertex = numbers[vertex];
  }
  result.positions.resize_for_overwrite(positions.size());
  std::ranges::copy(positions, result.positions.begin());
  result.triangles.resize_for_overwrite(triangles.size());
  std::ranges::copy(triangles, result.triangles.begin());
  return result;
}

void expect_kept(bool close, const ComponentFilter& filter, std::size_t kept) {
  Mesh mesh = specks(close);
  std::vector<Part> parts = parts_of(mesh);
  ASSERT_LE(kept, parts.size());
  const std::size_t all = parts.size();
  const std::size_t triangles = mesh.triangles.size();
  parts.resize(kept);
  const Mesh expected = only(mesh, parts);
  const Dropped dropped = keep_components(filter, {}, mesh);
  EXPECT_TRUE(test::same_bytes(mesh, expected));
  EXPECT_EQ(dropped.components, all - kept);
  EXPECT_EQ(dropped.triangles, triangles - mesh.triangles.size());
}

TEST(Components, AreNumberedByTheirFirstVertices) {
  const Mesh mesh = specks();
  Components components;
  find_components(mesh, {}, components);
  const std::vector<std::uint32_t> first = first_of(mesh);
  std::map<std::uint32_t, std::uint32_t> numbers;
  for (const std::uint32_t vertex : first) {
    numbers.emplace(vertex, static_cast<std::uint32_t>(numbers.size()));
  }
  EXPECT_GT(numbers.size(), 20U);
  EXPECT_EQ(components.count, numbers.size());
  ASSERT_EQ(components.of_vertex.size(), first.size());
  for (std::size_t v = 0; v < first.size(); ++v) {
    ASSERT_EQ(components.of_vertex[v], numbers[first[v]]) << v;
  }
}

TEST(KeepComponents, KeepsTheLargest) {
  const std::size_t all = parts_of(specks()).size();
  for (const bool close : {false, true}) {
    for (const std::uint32_t keep : {1U, 2U, 5U, 17U}) {
      SCOPED_TRACE(keep);
      expect_kept(close, {.keep = keep, .min_triangles = {}, .nearest_to = {}}, keep);
    }
  }
  expect_kept(
      false, {.keep = static_cast<std::uint32_t>(all), .min_triangles = {}, .nearest_to = {}}, all);
  expect_kept(false, {.keep = 4294967295, .min_triangles = {}, .nearest_to = {}}, all);
  expect_kept(false, {}, all);
}

TEST(KeepComponents, KeepsThoseOfEnoughTriangles) {
  const std::vector<Part> parts = parts_of(specks());
  const auto at_least = [&](std::uint64_t triangles) {
    return static_cast<std::size_t>(std::ranges::count_if(
        parts, [&](const Part& part) { return part.triangles >= triangles; }));
  };
  for (const std::uint32_t triangles : {1U, 24U, 25U, 100U}) {
    SCOPED_TRACE(triangles);
    expect_kept(false, {.keep = {}, .min_triangles = triangles, .nearest_to = {}},
                at_least(triangles));
  }
  expect_kept(false, {.keep = {}, .min_triangles = 4294967295, .nearest_to = {}}, 0);
  expect_kept(false, {.keep = 3, .min_triangles = 25, .nearest_to = {}},
              std::min<std::size_t>(3, at_least(25)));
  expect_kept(false, {.keep = 1000, .min_triangles = 25, .nearest_to = {}}, at_least(25));
}

TEST(KeepComponents, TakesTheFirstOfEqualOnes) {
  auto volume = test::constant<std::uint8_t>(0, {9, 9, 40});
  for (const std::uint64_t z : {3, 11, 19, 27, 35}) volume.at(4, 4, z) = 9;
  Mesh mesh = test::extracted(volume, {5, Scheme::kFive, Interpolation::kLinear});
  const Mesh all = test::extracted(volume, {5, Scheme::kFive, Interpolation::kLinear});
  const std::vector<Part> parts = parts_of(all);
  ASSERT_EQ(parts.size(), 5U);
  const Dropped dropped =
      keep_components({.keep = 2, .min_triangles = {}, .nearest_to = {}}, {}, mesh);
  EXPECT_EQ(dropped.components, 3U);
  EXPECT_TRUE(test::same_bytes(mesh, only(all, {parts[0], parts[1]})));
  EXPECT_LT(mesh.positions[mesh.positions.size() - 1][2], 13);
}

TEST(KeepComponents, AreTheSameOnAnyNumberOfThreads) {
  const auto make = [] {
    Mesh mesh = specks();
    keep_components({.keep = 9, .min_triangles = {}, .nearest_to = {}}, {}, mesh);
    return mesh;
  };
  test::expect_same_on_any_threads(make, test::kSameBytes);
}

TEST(KeepComponents, OfNothingAreNothing) {
  Mesh mesh = test::extracted(test::constant<std::uint8_t>(0, {5, 5, 5}), {5});
  EXPECT_EQ(keep_components({.keep = 1, .min_triangles = 5, .nearest_to = {}}, {}, mesh).components,
            0U);
  EXPECT_EQ(mesh.triangles.size(), 0U);
}

TEST(KeepComponents, StopBeforeAnythingIsChanged) {
  std::stop_source stop;
  stop.request_stop();
  Mesh mesh = specks();
  EXPECT_EQ(test::code_thrown_by([&] {
              keep_components({.keep = 1, .min_triangles = {}, .nearest_to = {}},
                              {stop.get_token(), {}}, mesh);
            }),
            ErrorCode::kCancelled);
  EXPECT_TRUE(test::same_bytes(mesh, specks()));
}

// The part whose vertex is nearest, whatever its size; and only of those what the other members
// keep.
TEST(Components, AreKeptWhereTheyAreNearestToAPlace) {
  const Mesh mesh = specks();
  const std::vector<std::uint32_t> first = first_of(mesh);
  const std::vector<Part> parts = parts_of(mesh);
  const auto triangles_at = [&](std::uint32_t vertex) {
    return std::ranges::find(parts, first[vertex], &Part::first)->triangles;
  };
  const auto near = [&](std::uint32_t vertex) {
    const Vec3& place = mesh.positions[vertex];
    return std::array<double, 3>{place[0] + 1e-3, place[1] - 1e-3, place[2]};
  };
  const std::uint32_t large = parts.front().first;
  const std::uint32_t small = parts.back().first;
  Mesh kept = specks();
  keep_components({.keep = {}, .min_triangles = {}, .nearest_to = {near(small)}}, {}, kept);
  EXPECT_TRUE(test::same_bytes(kept, only(mesh, {parts.back()})));
  kept = specks();
  ComponentFilter filter = {
      .keep = {}, .min_triangles = {}, .nearest_to = {near(small), near(large)}};
  const Dropped dropped = keep_components(filter, {}, kept);
  EXPECT_EQ(kept.triangles.size(), triangles_at(small) + triangles_at(large));
  EXPECT_EQ(dropped.components, parts.size() - 2);
  kept = specks();
  filter.keep = 1;
  keep_components(filter, {}, kept);
  EXPECT_TRUE(test::same_bytes(kept, only(mesh, {parts.front()})));
  kept = specks();
  filter = {.keep = {}, .min_triangles = parts.back().triangles + 1, .nearest_to = {near(small)}};
  keep_components(filter, {}, kept);
  EXPECT_EQ(kept.triangles.size(), 0U);
}

}  // namespace
}  // namespace isomesh::mesh
