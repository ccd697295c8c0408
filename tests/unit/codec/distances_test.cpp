// Distances to the extracted surface as an attribute of GLB's vertices.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <span>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "server/codec/encode.h"
#include "server/mesh/measure/distance.h"
#include "server/mesh/smooth/smooth.h"
#include "tests/support/errors.h"
#include "tests/support/kernels.h"
#include "tests/unit/codec/foreign.h"
#include "tests/unit/codec/glb_container.h"
#include "tests/unit/codec/label_files.h"
#include "tests/unit/codec/meshes.h"

namespace isomesh::codec {
namespace {

using nlohmann::json;
using test::GlbPrimitive;

// Tolerance relative to the largest distance: half a step of 12 bits, and the effect of rounded
// coordinates.
constexpr double kStep = 1.0 / 4095;

Provenance with_distances() {
  Provenance provenance;
  provenance.parameters.distances = true;
  return provenance;
}

// A surface, and what became of it when it was smoothed.
class Distances : public testing::Test {
 protected:
  Distances() : extracted_(test::several_blocks()), smoothed_(test::several_blocks()) {
    smooth({.steps = test::means(20, {1})}, {}, smoothed_);
  }

  std::string encoded(const Provenance& provenance) const {
    const mesh::TriangleGrid grid(extracted_, {});
    std::string bytes;
    encode(
        smoothed_, MeshFormat::kGlb, provenance, {},
        [&](std::span<const std::byte> piece) {
          bytes.append(reinterpret_cast<const char*>(piece.data()), piece.size());
        },
        &grid);
    return bytes;
  }

  // Expects the distances stored in each primitive to match those measured at its own points.
  void expect_measured(const std::vector<GlbPrimitive>& primitives, double tolerance) const {
    const mesh::TriangleGrid grid(extracted_, {});
    mesh::Buffer<float> measured;
    for (const GlbPrimitive& primitive : primitives) {
      ASSERT_EQ(primitive.distances.size(), primitive.mesh.points.size());
      measure_vertex_distances({primitive.mesh.points, primitive.mesh.triangles}, grid, {},
                               measured);
      for (std::size_t v = 0; v < measured.size(); ++v) {
        ASSERT_NEAR(primitive.distances[v], measured[v], tolerance);
      }
    }
  }

  // Covers the rounding of the points and of the distances.
  double tolerance() const {
    const mesh::TriangleGrid grid(extracted_, {});
    mesh::Buffer<float> measured;
    measure_vertex_distances(smoothed_, grid, {}, measured);
    const double most = *std::ranges::max_element(measured);
    EXPECT_GT(most, 0.05) << "smoothing moved nothing";
    constexpr double kSide = 128;  // of the whole, at most
    return most * kStep + std::sqrt(3.0) * kSide / (1 << DracoParameters{}.position_bits);
  }

  const mesh::Mesh extracted_;
  mesh::Mesh smoothed_;
};

TEST_F(Distances, AreOfEachVertexAsReadersThatAreNotOursDecodeThem) {
  const auto primitives = test::read_with_node(encoded(with_distances()));
  ASSERT_GT(primitives.size(), 1U);
  expect_measured(primitives, tolerance());
}

TEST_F(Distances, AreTheSameOnBothSidesOfASeam) {
  std::map<mesh::Vec3, float> of_place;
  std::size_t shared = 0;
  for (const GlbPrimitive& primitive : test::read_with_node(encoded(with_distances()))) {
    for (std::size_t v = 0; v < primitive.distances.size(); ++v) {
      const auto [entry, is_new] =
          of_place.emplace(primitive.mesh.points[v], primitive.distances[v]);
      if (is_new) continue;
      ++shared;
      ASSERT_EQ(entry->second, primitive.distances[v]);
    }
  }
  EXPECT_GT(shared, 100U);
}

TEST_F(Distances, StandBesideNormalsAndInEveryLevelOfDetail) {
  Provenance provenance = with_distances();
  provenance.parameters.normals = true;
  provenance.parameters.lods = {1, 0.25};
  const std::string glb = encoded(provenance);
  const json document = test::open_container(glb).document;
  for (const json& mesh : document["meshes"]) {
    for (const json& primitive : mesh["primitives"]) {
      const json& draco = primitive["extensions"]["KHR_draco_mesh_compression"]["attributes"];
      std::set<std::string> names;
      for (const auto& [name, id] : draco.items()) names.insert(name);
      EXPECT_EQ(names, (std::set<std::string>{"POSITION", "NORMAL", "_DISTANCE_MM"}));
    }
  }
  const auto primitives = test::read_with_node(glb);
  for (const GlbPrimitive& primitive : primitives) {
    EXPECT_EQ(primitive.normals.size(), primitive.mesh.points.size());
  }
  expect_measured(primitives, tolerance());
}

TEST_F(Distances, AreAccessorsOfSingleFloats) {
  const json document = test::open_container(encoded(with_distances())).document;
  for (const json& primitive : document["meshes"][0]["primitives"]) {
    const json& attributes = primitive["attributes"];
    const json& accessor = document["accessors"][attributes["_DISTANCE_MM"].get<std::size_t>()];
    const json& positions = document["accessors"][attributes["POSITION"].get<std::size_t>()];
    EXPECT_EQ(accessor["type"], "SCALAR");
    EXPECT_EQ(accessor["componentType"], 5126);
    EXPECT_EQ(accessor["count"], positions["count"]);
  }
  EXPECT_EQ(document["asset"]["extras"]["parameters"]["distances"], true);
}

TEST_F(Distances, AreZeroOfASurfaceThatStayed) {
  smoothed_ = test::several_blocks();
  for (const GlbPrimitive& primitive : test::read_with_node(encoded(with_distances()))) {
    ASSERT_EQ(primitive.distances.size(), primitive.mesh.points.size());
    EXPECT_TRUE(std::ranges::all_of(primitive.distances, [](float d) { return d == 0; }));
  }
}

TEST_F(Distances, AreNotThereUnlessAskedFor) {
  const std::string glb = encoded({});
  EXPECT_EQ(glb, test::encoded(smoothed_, MeshFormat::kGlb, Provenance{}));
  EXPECT_EQ(glb.find("distance"), std::string::npos);
  EXPECT_EQ(glb.find("DISTANCE"), std::string::npos);
}

TEST_F(Distances, NeedASurfaceThatTheyAreMeasuredTo) {
  const auto encode_without = [&] {
    encode(smoothed_, MeshFormat::kGlb, with_distances(), {}, [](auto) {});
  };
  EXPECT_EQ(test::code_thrown_by(encode_without), ErrorCode::kInternal);
}

class LabelDistances : public test::LabelFilesTest {};

TEST_F(LabelDistances, AreOfTheWallsAndTheSameInBothLabelsOfOne) {
  provenance_.parameters.distances = true;
  mesh::SeparatingSurface before;
  separate_into(before, mesh::label_cells(kLabels, {30, 26, 28}, 12, 401),
                {mesh::consecutive<std::int64_t>(1, kLabels), Scheme::kSix, true});
  const mesh::TriangleGrid grid(before.mesh, {});
  std::string glb;
  encode_labels({walls_, surfaces_, labels_, &grid}, MeshFormat::kGlb, provenance_, {},
                [&](std::span<const std::byte> piece) {
                  glb.append(reinterpret_cast<const char*>(piece.data()), piece.size());
                });
  const auto primitives = test::read_with_node(glb);
  ASSERT_EQ(primitives.size(), kLabels);
  std::map<mesh::Vec3, float> of_place;
  std::size_t shared = 0;
  mesh::Buffer<float> measured;
  for (const GlbPrimitive& primitive : primitives) {
    ASSERT_EQ(primitive.distances.size(), primitive.mesh.points.size());
    measure_vertex_distances({primitive.mesh.points, primitive.mesh.triangles}, grid, {}, measured);
    for (std::size_t v = 0; v < measured.size(); ++v) {
      EXPECT_NEAR(primitive.distances[v], measured[v], 0.01);
      const auto [entry, is_new] =
          of_place.emplace(primitive.mesh.points[v], primitive.distances[v]);
      if (is_new) continue;
      ++shared;
      EXPECT_EQ(entry->second, primitive.distances[v]);
    }
  }
  EXPECT_GT(shared, 100U);
}

}  // namespace
}  // namespace isomesh::codec
