// Blocks of triangles as the arrays of EXT_meshopt_compression, on one shared quantisation grid;
// private to this folder.
#pragma once

#include <cstddef>
#include <vector>

#include "server/codec/draco_chunk.h"
#include "server/mesh/mesh.h"

namespace isomesh::codec {

struct MeshoptArray {
  enum class Kind { kPositions, kNormals, kDistances, kIndices };

  Kind kind = Kind::kPositions;
  std::size_t begin = 0;  // a multiple of four
  std::size_t bytes = 0;
  std::size_t stride = 0;  // of a decoded element, in bytes
  std::size_t count = 0;
};

struct MeshoptChunk {
  std::vector<std::byte> bytes;
  std::vector<MeshoptArray> arrays;
  std::uint32_t vertices = 0;
  std::uint32_t triangles = 0;
  mesh::Vec3 low = {0, 0, 0};  // bounds of the stored positions
  mesh::Vec3 high = {0, 0, 0};
};

// Positions are grid steps, as 16-bit numbers, on grids of at most this many bits; otherwise
// floats.
inline constexpr int kMostMeshoptBits = 16;
constexpr bool is_on_steps(const Grid& grid) { return grid.bits <= kMostMeshoptBits; }

// Encodes the block's triangles and their vertices, in an order that compresses well. `data` is
// indexed by the mesh's vertices: normals become octahedral with 8 bits, distances stay exact.
MeshoptChunk encode_with_meshopt(const mesh::Mesh& mesh, const Block& block, const Grid& grid,
                                 const VertexData& data);

}  // namespace isomesh::codec
