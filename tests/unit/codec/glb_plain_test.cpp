// GLB without a codec: the mesh as it is, for readers that decode nothing.
#include <algorithm>
#include <cstdint>
#include <limits>
#include <map>
#include <set>
#include <span>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "server/codec/formats.h"
#include "server/mesh/labels/label_surface.h"
#include "server/mesh/measure/distance.h"
#include "server/mesh/measure/normals.h"
#include "tests/support/any_threads.h"
#include "tests/support/errors.h"
#include "tests/unit/codec/foreign.h"
#include "tests/unit/codec/glb_container.h"
#include "tests/unit/codec/label_files.h"
#include "tests/unit/codec/meshes.h"

namespace isomesh::codec {
namespace {

using mesh::Vec3;
using nlohmann::json;
using test::encoded;

constexpr const char* kManifold = "EXT_mesh_manifold";

Provenance plain() {
  Provenance provenance;
  provenance.parameters.glb_codec = GlbCodec::kNone;
  return provenance;
}

std::string plain_glb(const mesh::Mesh& mesh) { return encoded(mesh, MeshFormat::kGlb, plain()); }

std::string encoded_to_text(const mesh::Mesh& mesh, const Provenance& provenance,
                            const mesh::TriangleGrid* extracted) {
  std::string bytes;
  encode(
      mesh, MeshFormat::kGlb, provenance, {},
      [&](std::span<const std::byte> piece) {
        bytes.append(reinterpret_cast<const char*>(piece.data()), piece.size());
      },
      extracted);
  return bytes;
}

std::vector<std::array<Vec3, 3>> corners_of(const mesh::Mesh& mesh) {
  std::vector<std::array<Vec3, 3>> corners;
  for (const auto& [a, b, c] : mesh.triangles) {
    corners.push_back({mesh.positions[a], mesh.positions[b], mesh.positions[c]});
  }
  return corners;
}

void expect_same_arrays(const test::DecodedMesh& read, const mesh::Mesh& mesh) {
  EXPECT_TRUE(std::ranges::equal(read.points, mesh.positions));
  EXPECT_TRUE(std::ranges::equal(read.triangles, mesh.triangles));
}

std::vector<bool> solid_meshes(const json& document) {
  std::vector<bool> solid;
  for (const json& mesh : document["meshes"]) {
    solid.push_back(mesh.contains("extensions") && mesh["extensions"].contains(kManifold));
  }
  return solid;
}

TEST(PlainGlb, HasTheSameFloatsAndTrianglesForAssimp) {
  for (const auto& [name, mesh] : test::meshes_to_encode()) {
    SCOPED_TRACE(name);
    EXPECT_TRUE(test::read_exactly(plain_glb(mesh), MeshFormat::kGlb) == corners_of(mesh));
  }
  const mesh::Mesh mesh = test::large_mesh();
  EXPECT_TRUE(test::read_exactly(plain_glb(mesh), MeshFormat::kGlb) == corners_of(mesh));
}

TEST(PlainGlb, HasTheSameVerticesAndNormalsForGltfValidator) {
  for (const auto& [name, mesh] : test::meshes_to_encode()) {
    if (name.starts_with("flat") || name == "oblique") continue;  // node takes its time to start
    SCOPED_TRACE(name);
    const auto primitives = test::read_with_node(plain_glb(mesh));
    ASSERT_EQ(primitives.size(), 1U);
    expect_same_arrays(primitives[0].mesh, mesh);
    mesh::Buffer<Vec3> normals;
    vertex_normals(mesh, {}, normals);
    EXPECT_TRUE(std::ranges::equal(primitives[0].normals, normals));
  }
}

// VTK puts the points where the nodes do, and rounds them to floats there.
TEST(PlainGlb, HasTheSameVerticesForVtkInMetresWithYUp) {
  const mesh::Mesh mesh = test::large_mesh();
  const auto read = test::read_with_python(plain_glb(mesh), MeshFormat::kGlb);
  EXPECT_EQ(read.told["arrays"], json({{"NORMAL"}}));
  EXPECT_TRUE(std::ranges::equal(read.mesh.triangles, mesh.triangles));
  ASSERT_EQ(read.mesh.points.size(), mesh.positions.size());
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const auto& [x, y, z] = mesh.positions[v];
    const Vec3 expected = {x / 1000, z / 1000, -y / 1000};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      ASSERT_NEAR(read.mesh.points[v][axis], expected[axis], 1e-8) << v;
    }
  }
}

TEST(PlainGlb, IsOnePrimitiveThatNeedsNoExtension) {
  const mesh::Mesh mesh = test::several_blocks();
  const json document = test::open_container(plain_glb(mesh)).document;
  EXPECT_FALSE(document.contains("extensionsRequired"));
  ASSERT_EQ(document["meshes"].size(), 1U);
  EXPECT_EQ(document["meshes"][0]["primitives"].size(), 1U);
  EXPECT_EQ(document["buffers"].size(), 1U);
  const json& primitive = document["meshes"][0]["primitives"][0];
  const json& positions =
      document["accessors"][primitive["attributes"]["POSITION"].get<std::size_t>()];
  EXPECT_EQ(positions["count"], mesh.positions.size());
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto [low, high] = std::ranges::minmax_element(
        mesh.positions, {}, [&](const Vec3& position) { return position[axis]; });
    EXPECT_EQ(positions["min"][axis].get<double>(), (*low)[axis]);
    EXPECT_EQ(positions["max"][axis].get<double>(), (*high)[axis]);
  }
}

TEST(PlainGlb, SaysThatASurfaceIsSolidOnlyIfItIs) {
  const std::set<std::string> solid = {"closed", "oblique", "left-handed", "far", "two closed"};
  for (const auto& [name, mesh] : test::meshes_to_encode()) {
    SCOPED_TRACE(name);
    const json document = test::open_container(plain_glb(mesh)).document;
    const bool is_solid = solid.contains(name);
    EXPECT_EQ(solid_meshes(document), std::vector<bool>{is_solid});
    if (!is_solid) {
      EXPECT_FALSE(document.contains("extensionsUsed"));
      continue;
    }
    EXPECT_EQ(document["extensionsUsed"], json({kManifold}));
    const json& told = document["meshes"][0];
    const json& primitive = told["primitives"][0];
    const json expected = {{"attributes", {{"POSITION", primitive["attributes"]["POSITION"]}}},
                           {"indices", primitive["indices"]},
                           {"mode", 4}};
    EXPECT_EQ(told["extensions"][kManifold], json({{"manifoldPrimitive", expected}}));
  }
  mesh::Mesh turned = std::move(test::meshes_to_encode().at(2).mesh);
  std::swap(turned.triangles[0][0], turned.triangles[0][1]);
  EXPECT_EQ(solid_meshes(test::open_container(plain_glb(turned)).document),
            std::vector<bool>{false});
}

TEST(PlainGlb, OfMoreThan4GiBIsRefusedBeforeItsTrianglesAreRead) {
  constexpr std::size_t kMost = std::numeric_limits<std::uint32_t>::max();
  mesh::Mesh mesh;
  mesh.positions.resize_for_overwrite(1);
  mesh.positions[0] = {};
  mesh.triangles.resize_for_overwrite(kMost / sizeof(mesh::Triangle) + 1);  // takes no memory
  const Error error = test::error_of([&] { plain_glb(mesh); });
  EXPECT_EQ(error.code(), ErrorCode::kTooLarge);
  EXPECT_THAT(error.what(), testing::HasSubstr("\"glb_codec\" to \"draco\""));
}

TEST(PlainGlb, OfNothingIsAFileWithoutAMesh) {
  EXPECT_TRUE(test::read_with_node(plain_glb(mesh::Mesh{})).empty());
}

TEST(PlainGlb, HasExactDistancesAndNoNormalsIfNotAskedFor) {
  const mesh::Mesh mesh = test::several_blocks();
  const mesh::Mesh other = test::large_mesh();
  const mesh::TriangleGrid grid(other, {});
  Provenance provenance = plain();
  provenance.parameters.distances = true;
  provenance.parameters.normals = false;
  const auto primitives = test::read_with_node(encoded_to_text(mesh, provenance, &grid));
  ASSERT_EQ(primitives.size(), 1U);
  EXPECT_TRUE(primitives[0].normals.empty());
  mesh::Buffer<float> measured;
  measure_vertex_distances(mesh, grid, {}, measured);
  EXPECT_TRUE(std::ranges::equal(primitives[0].distances, measured));
}

TEST(PlainGlb, HasCoarserLevelsAsMeshesOfTheirOwn) {
  const mesh::Mesh mesh = test::several_blocks();
  Provenance provenance = plain();
  provenance.parameters.lods = {1, 0.25, 0.05};
  const std::string glb = encoded(mesh, MeshFormat::kGlb, provenance);
  const json document = test::open_container(glb).document;
  EXPECT_EQ(document["extensionsUsed"], json({kManifold, "MSFT_lod"}));
  EXPECT_EQ(solid_meshes(document), std::vector<bool>(3, true));
  const auto primitives = test::read_with_node(glb);
  ASSERT_EQ(primitives.size(), 3U);
  expect_same_arrays(primitives[0].mesh, mesh);
  const std::set<Vec3> places(mesh.positions.begin(), mesh.positions.end());
  for (std::size_t level = 1; level < 3; ++level) {
    EXPECT_NEAR(static_cast<double>(primitives[level].mesh.triangles.size()),
                provenance.parameters.lods[level] * static_cast<double>(mesh.triangles.size()),
                0.01 * static_cast<double>(mesh.triangles.size()));
    EXPECT_TRUE(std::ranges::all_of(primitives[level].mesh.points,
                                    [&](const Vec3& point) { return places.contains(point); }));
  }
  const auto offset_of = [&](std::size_t level) {
    const json& primitive = document["meshes"][level]["primitives"][0];
    const json& indices = document["accessors"][primitive["indices"].get<std::size_t>()];
    const json& view = document["bufferViews"][indices["bufferView"].get<std::size_t>()];
    return view["byteOffset"].get<std::size_t>();
  };
  EXPECT_LT(offset_of(2), offset_of(1)) << "the coarsest comes first";
  EXPECT_LT(offset_of(1), offset_of(0));
}

TEST(PlainGlb, IsTheSameOnAnyNumberOfThreads) {
  test::expect_same_on_any_threads([] { return plain_glb(test::large_mesh()); });
}

TEST(PlainGlb, IsHandedOverInPiecesWhileProgressGrowsToOne) {
  const mesh::Mesh mesh = test::several_blocks();
  double last = 0;
  const auto note = [&](double done) {
    EXPECT_GE(done, last);
    last = done;
  };
  std::size_t largest = 0;
  encode(mesh, MeshFormat::kGlb, plain(), {{}, note},
         [&](auto piece) { largest = std::max(largest, piece.size()); });
  EXPECT_EQ(last, 1);
  EXPECT_LT(largest, 1U << 20);
}

TEST(PlainGlb, StopsOnceItIsCancelled) {
  std::stop_source source;
  std::size_t pieces = 0;
  const auto stop_at_data = [&](std::span<const std::byte>) {
    if (++pieces == 5) source.request_stop();  // the header, the JSON, and a piece
  };
  EXPECT_EQ(test::code_thrown_by([&] {
              encode(test::several_blocks(), MeshFormat::kGlb, plain(), {source.get_token(), {}},
                     stop_at_data);
            }),
            ErrorCode::kCancelled);
  EXPECT_EQ(pieces, 5U);
}

TEST(PlainGlb, ShowsTheTopologyAndRoundsNothing) {
  const mesh::Mesh mesh = test::several_blocks();
  const Provenance provenance = plain();
  const auto shown = encode(mesh, MeshFormat::kGlb, provenance, {}, [](auto) {});
  ASSERT_TRUE(shown);
  EXPECT_EQ(*shown, measure_topology(mesh, {}));
  EXPECT_TRUE(describe(MeshFormat::kGlb).shows_topology(provenance.parameters));
  EXPECT_FALSE(rounds(MeshFormat::kGlb, provenance.parameters));
  EXPECT_TRUE(rounds(MeshFormat::kGlb, {}));
}

TEST(PlainGlb, HasTheSizeThatItsRowTells) {
  const mesh::Mesh mesh = test::several_blocks();
  const Format& row = describe(MeshFormat::kGlb);
  const mesh::SurfaceSize surface = {mesh.triangles.size(), mesh.positions.size()};
  for (const bool normals : {false, true}) {
    Provenance provenance = plain();
    provenance.parameters.normals = normals;
    ASSERT_TRUE(row.has_exact_bytes(provenance.parameters));
    EXPECT_NEAR(row.bytes(surface, provenance.parameters),
                static_cast<double>(encoded(mesh, MeshFormat::kGlb, provenance).size()), 2000);
  }
  MeshParameters others = plain().parameters;
  others.lods = {1, 0.5};
  EXPECT_FALSE(row.has_exact_bytes(others)) << "levels may have more triangles";
  for (const GlbCodec codec : values_of<GlbCodec>()) {
    Provenance provenance;
    provenance.parameters.glb_codec = codec;
    const auto bytes = static_cast<double>(encoded(mesh, MeshFormat::kGlb, provenance).size());
    EXPECT_LT(row.bytes(surface, provenance.parameters), 2 * bytes) << to_string(codec);
    EXPECT_GT(2 * row.bytes(surface, provenance.parameters), bytes) << to_string(codec);
  }
}

class PlainGlbOfLabels : public test::LabelFilesTest {
 protected:
  PlainGlbOfLabels() { provenance_.parameters.glb_codec = GlbCodec::kNone; }
};

TEST_F(PlainGlbOfLabels, HasEachLabelsOwnVerticesAndNormals) {
  const std::string glb = encoded(MeshFormat::kGlb);
  const auto primitives = test::read_with_node(glb);
  ASSERT_EQ(primitives.size(), kLabels);
  std::vector<std::array<Vec3, 3>> all;
  for (std::size_t n = 1; n <= kLabels; ++n) {
    const mesh::Mesh& own = surfaces_[n - 1].mesh;
    expect_same_arrays(primitives[n - 1].mesh, own);
    const auto normals = shading_of(surfaces_[n - 1], walls_, {});
    EXPECT_TRUE(std::ranges::equal(primitives[n - 1].normals, normals));
    const auto corners = corners_of(own);
    all.insert(all.end(), corners.begin(), corners.end());
  }
  EXPECT_TRUE(test::read_exactly(glb, MeshFormat::kGlb) == all) << "assimp";
  const auto read = test::read_with_python(glb, MeshFormat::kGlb);
  EXPECT_EQ(read.mesh.triangles.size(), all.size()) << "VTK";
}

TEST_F(PlainGlbOfLabels, SaysWhichLabelsAreSolid) {
  const json document = test::open_container(encoded(MeshFormat::kGlb)).document;
  std::vector<bool> expected;
  for (const LabelSummary& label : labels_) {
    expected.push_back(label.closed && label.manifold && label.oriented);
  }
  EXPECT_EQ(solid_meshes(document), expected);
  EXPECT_EQ(document["nodes"][2]["name"], *labels_[1].name);
  EXPECT_EQ(document["nodes"][2]["extras"]["label"], 2);
}

TEST_F(PlainGlbOfLabels, SharesWallsToTheBitOnEveryLevel) {
  provenance_.parameters.lods = {1, 0.3};
  const std::string glb = encoded(MeshFormat::kGlb);
  const json document = test::open_container(glb).document;
  const auto primitives = test::read_with_node(glb);
  ASSERT_EQ(primitives.size(), 2 * kLabels);
  for (const std::size_t level : {std::size_t{0}, std::size_t{1}}) {
    std::map<Vec3, int> uses;
    std::size_t points = 0;
    for (std::size_t n = 0; n < kLabels; ++n) {
      const auto& read = primitives[2 * n + level].mesh.points;
      points += read.size();
      for (const Vec3& point : read) ++uses[point];
    }
    const auto shared = std::ranges::count_if(uses, [](const auto& use) { return use.second > 1; });
    EXPECT_GT(shared, static_cast<std::ptrdiff_t>(points / 10)) << level;
    // Every place of the walls is in some label, and no other place.
    if (level == 0) {
      EXPECT_EQ(uses.size(), walls_.mesh.positions.size());
    }
  }
}

TEST_F(PlainGlbOfLabels, HasDistancesToTheWallsAndTheSameOnAnyNumberOfThreads) {
  provenance_.parameters.distances = true;
  provenance_.parameters.lods = {1, 0.3};
  const mesh::TriangleGrid grid(walls_.mesh, {});
  const auto make = [&] {
    std::string glb;
    encode_labels({walls_, surfaces_, labels_, &grid}, MeshFormat::kGlb, provenance_, {},
                  [&](std::span<const std::byte> piece) {
                    glb.append(reinterpret_cast<const char*>(piece.data()), piece.size());
                  });
    return glb;
  };
  test::expect_same_on_any_threads(make);
  for (const auto& primitive : test::read_with_node(make())) {
    ASSERT_EQ(primitive.distances.size(), primitive.mesh.points.size());
    EXPECT_EQ(primitive.normals.size(), primitive.mesh.points.size());
  }
}

}  // namespace
}  // namespace isomesh::codec
