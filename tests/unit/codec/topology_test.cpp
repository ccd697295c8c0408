// Tests that the topology that encoders report equals the one measured on the mesh itself.
#include "server/mesh/topology/topology.h"

#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "server/codec/draco_chunk.h"
#include "server/codec/formats.h"
#include "tests/support/kernels.h"
#include "tests/unit/codec/made_up_meshes.h"
#include "tests/unit/codec/meshes.h"

namespace isomesh::codec {
namespace {

using mesh::Topology;
using test::mesh_of;

// By blocks of about so many triangles.
std::optional<Topology> shown_by_blocks(const mesh::Mesh& mesh, std::size_t triangles) {
  DracoEncoder encoder;
  std::vector<DracoStream> streams;
  for (const Block& block : cut_blocks(mesh, triangles)) {
    streams.push_back(encoder.encode_block(mesh, block, {grid_of(mesh, 14)}, {}, {}));
  }
  return topology_of(mesh, streams, {});
}

std::optional<Topology> shown_by_whole(const mesh::Mesh& mesh) {
  std::vector<DracoStream> streams(1);
  streams[0] = DracoEncoder().encode_whole(mesh, {grid_of(mesh, 14)}, {}, {});
  return topology_of(mesh, streams, {});
}

mesh::Mesh noise(Scheme scheme, bool close) {
  return test::extracted(test::noise<std::uint8_t>({0, 1}, {21, 19, 45}, 4),
                         {0.5, scheme, Interpolation::kLinear, close});
}

TEST(ShownTopology, IsTheMeasuredOne) {
  std::vector<test::NamedMesh> meshes = test::meshes_to_encode();
  for (const Scheme scheme : {Scheme::kFive, Scheme::kSix}) {
    meshes.push_back({"open noise", noise(scheme, false)});
    meshes.push_back({"closed noise", noise(scheme, true)});
  }
  meshes.push_back({"several blocks", test::several_blocks()});
  for (const auto& [name, mesh] : meshes) {
    SCOPED_TRACE(name);
    if (mesh.triangles.size() == 0) continue;
    const Topology measured = measure_topology(mesh, {});
    EXPECT_EQ(shown_by_whole(mesh), measured);
    for (const std::size_t blocks : {2, 9, 60}) {
      const std::size_t triangles = mesh.triangles.size() / blocks + 1;
      EXPECT_EQ(shown_by_blocks(mesh, triangles), measured) << triangles;
    }
  }
}

// Surfaces of every kind, also such as are no manifold: what is shown is right, or there is
// nothing.
TEST(ShownTopology, IsTheMeasuredOneOrNone) {
  constexpr std::size_t kBytes = 1200;
  std::size_t shown = 0;
  std::size_t faulty = 0;
  for (std::uint64_t seed = 0; seed < 75; ++seed) {
    const test::MadeUpMesh made = test::mesh_from_bytes(test::random_bytes(seed, kBytes));
    if (!made.is_finite || made.has_wrong_layers || made.mesh.triangles.size() == 0) continue;
    const Topology measured = measure_topology(made.mesh, {});
    std::vector<std::optional<Topology>> found = {shown_by_whole(made.mesh)};
    for (const std::size_t triangles : {1, 9, 60}) {
      found.push_back(shown_by_blocks(made.mesh, triangles));
    }
    for (const auto& topology : found) {
      if (!topology) continue;
      EXPECT_EQ(*topology, measured) << seed;
      ++shown;
      if (!topology->manifold) ++faulty;
    }
  }
  EXPECT_GT(shown, 75U);
  EXPECT_GT(faulty, 2U) << "some faults lie between blocks, and are to be found there";
}

// One corner changed anywhere does not go unseen, wherever the blocks are cut.
TEST(ShownTopology, HasEveryFault) {
  constexpr std::size_t kFaults = 10;
  for (std::size_t fault = 0; fault < kFaults; ++fault) {
    mesh::Mesh mesh = noise(Scheme::kSix, true);
    const std::size_t layer = 1 + (mesh.layers() - 3) * fault / kFaults;
    const std::size_t first = mesh.layer_triangles[layer];
    const std::size_t count = mesh.layer_triangles[layer + 1] - first;
    std::uint32_t& corner = mesh.triangles[first + count * fault / kFaults][fault % 3];
    corner = static_cast<std::uint32_t>(
        corner == mesh.layer_vertices[layer] ? corner + 1 : mesh.layer_vertices[layer]);
    const Topology measured = measure_topology(mesh, {});
    ASSERT_GT(measured.boundary_edges, 0U);
    for (const std::size_t triangles : {1000, 9000}) {
      const auto topology = shown_by_blocks(mesh, triangles);
      if (topology) {
        EXPECT_EQ(*topology, measured) << fault;
      }
    }
  }
}

// A triangle that no other block knows of, at a vertex that is inner in one of them.
TEST(ShownTopology, IsNoneWhereABlockCannotKnow) {
  mesh::Mesh mesh = noise(Scheme::kSix, true);
  const Topology measured = measure_topology(mesh, {});
  std::vector<DracoStream> streams(2);
  DracoEncoder encoder;
  streams[0] = encoder.encode_whole(mesh, {grid_of(mesh, 14)}, {}, {});
  streams[1] = encoder.encode_block(mesh, {{0, 1}}, {grid_of(mesh, 14)}, {}, {});
  EXPECT_FALSE(topology_of(mesh, streams, {}));
  EXPECT_EQ(shown_by_whole(mesh), measured);
}

TEST(ShownTopology, IsReturnedByTheFormatsThatSayTheyShowIt) {
  const mesh::Mesh mesh = test::several_blocks();
  for (const MeshFormat format :
       {MeshFormat::kDrc, MeshFormat::kGlb, MeshFormat::kStl, MeshFormat::kPly, MeshFormat::kObj}) {
    Provenance provenance;
    const auto shown = encode(mesh, format, provenance, {}, [](auto) {});
    EXPECT_EQ(shown.has_value(), describe(format).shows_topology(provenance.parameters));
    if (shown) {
      EXPECT_EQ(*shown, measure_topology(mesh, {}));
    }
    provenance.parameters.draco.speed = 0;
    EXPECT_FALSE(describe(format).shows_topology(provenance.parameters));
  }
}

}  // namespace
}  // namespace isomesh::codec
