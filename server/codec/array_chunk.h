// Blocks of triangles as arrays of a glTF buffer, quantised on one shared grid: raw, or compressed
// by meshoptimizer. Private to this folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "proto/types.h"
#include "server/codec/bounds.h"
#include "server/codec/draco_chunk.h"
#include "server/mesh/mesh.h"

namespace isomesh::codec {

// Alignment of chunks and buffer views, in bytes.
inline constexpr std::size_t kGlbAlignment = 4;

constexpr std::size_t glb_padded(std::size_t bytes) {
  return (bytes + kGlbAlignment - 1) / kGlbAlignment * kGlbAlignment;
}

struct GlbArray {
  enum class Kind { kPositions, kNormals, kDistances, kIndices };

  Kind kind = Kind::kPositions;
  std::size_t begin = 0;   // in the chunk; aligned
  std::size_t bytes = 0;   // as stored
  std::size_t stride = 0;  // of an element, in bytes; of a decoded one if it is compressed
  std::size_t count = 0;
};

// The arrays of one primitive.
struct ArrayChunk {
  std::vector<std::byte> bytes;  // empty if the arrays are only described
  std::vector<GlbArray> arrays;
  std::uint32_t vertices = 0;
  std::uint32_t triangles = 0;
  Bounds bounds = {};  // of the stored positions

  std::size_t size() const {
    return arrays.empty() ? 0 : glb_padded(arrays.back().begin + arrays.back().bytes);
  }
};

// Positions are grid steps, as 16-bit numbers, on grids of at most this many bits; otherwise
// floats.
inline constexpr int kMostStepBits = 16;
constexpr bool is_on_steps(const Grid& grid) { return grid.bits <= kMostStepBits; }

// Encodes the block's triangles and their vertices, in an order that compresses well. `data` is
// indexed by the mesh's vertices: normals get 8 bits, distances stay exact. With kQuantized the
// arrays are raw, and indices have 16 bits if the block has few vertices; otherwise they are
// compressed ("EXT_meshopt_compression", appendix A, which "KHR_meshopt_compression" calls version
// 0), and normals are octahedral.
ArrayChunk encode_arrays(const mesh::Mesh& mesh, const Block& block, const Grid& grid,
                         const VertexData& data, GlbCodec codec);

}  // namespace isomesh::codec
