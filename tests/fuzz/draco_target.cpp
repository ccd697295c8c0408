#include "tests/fuzz/draco_target.h"

#include <stdexcept>

#include "proto/error.h"
#include "server/codec/draco/encoder.h"
#include "server/codec/encode.h"
#include "server/mesh/topology/topology_parts.h"
#include "tests/unit/codec/made_up_meshes.h"
#include "tests/unit/codec/stream_check.h"

namespace isomesh::fuzz {
namespace {

using codec::edgebreaker::Encoder;
using codec::edgebreaker::Threads;
using test::MadeUpMesh;
using test::MaySplit;

void expect_same(std::string_view drc, const MadeUpMesh& made, MaySplit may_split) {
  const std::string difference =
      test::difference(drc, made.mesh, made.draco.position_bits, may_split);
  if (!difference.empty()) throw std::logic_error(difference);
}

void expect_topology(const mesh::PartTopology& all, const mesh::Mesh& mesh) {
  const auto shown = mesh::join_topology(mesh, {&all, 1}, {});
  if (shown != mesh::measure_topology(mesh, {})) {
    throw std::logic_error("the encoder shows another topology than is measured");
  }
}

void encode_as_drc(const MadeUpMesh& made) {
  std::string drc;
  codec::encode_drc(made.mesh, made.draco, {}, [&](std::span<const std::byte> piece) {
    drc.append(reinterpret_cast<const char*>(piece.data()), piece.size());
  });
  if (made.mesh.triangles.size() > 0) expect_same(drc, made, MaySplit::kYes);
}

// Also ahead of itself, which it does for large surfaces only.
void encode_by_our_own(const MadeUpMesh& made) {
  const codec::Grid grid = codec::grid_of(made.mesh, made.draco.position_bits);
  for (const std::size_t look_ahead : {std::size_t{0}, Encoder::kLeastToLookAhead}) {
    const auto encoded = Encoder(look_ahead)
                             .encode({made.mesh.positions.span(), made.mesh.triangles.span(),
                                      made.mesh.layer_vertices, made.mesh.layer_triangles},
                                     grid, Threads::kOne, {});
    if (!encoded) return;
    expect_same({reinterpret_cast<const char*>(encoded->bytes.data()), encoded->bytes.size()}, made,
                made.is_manifold ? MaySplit::kNo : MaySplit::kYes);
    if (encoded->topology && !made.has_wrong_layers) expect_topology(*encoded->topology, made.mesh);
  }
}

}  // namespace

void encode_mesh(std::span<const std::byte> bytes) {
  const MadeUpMesh made = test::mesh_from_bytes(bytes);
  try {
    encode_as_drc(made);
    encode_by_our_own(made);
  } catch (const Error& error) {
    if (made.is_finite || error.code() != ErrorCode::kUnusableVolume) throw;
  }
}

std::vector<std::string> meshes_to_encode() {
  std::vector<std::string> inputs;
  constexpr std::uint64_t kInputs = 24;
  constexpr std::size_t kBytes = 1500;
  for (std::uint64_t seed = 0; seed < kInputs; ++seed) {
    std::string& input = inputs.emplace_back();
    for (const std::byte byte : test::random_bytes(seed, kBytes)) {
      input.push_back(static_cast<char>(byte));
    }
    input[2] = static_cast<char>(seed % 8);  // every kind of mesh
  }
  return inputs;
}

}  // namespace isomesh::fuzz
