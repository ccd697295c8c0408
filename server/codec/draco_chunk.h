// Blocks of triangles as Draco streams on one shared quantisation grid; private to this folder.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "proto/types.h"
#include "server/mesh/mesh.h"

namespace isomesh::codec {

// The cube that all positions are quantised in: the mesh's lowest corner and its longest side. A
// position on it decodes to the same bits in every stream that uses the grid.
struct Grid {
  mesh::Vec3 low = {0, 0, 0};
  float side = 0;
  int bits = 14;

  // What a coordinate along an axis becomes by encoding and decoding.
  float decoded(float coordinate, std::size_t axis) const;
};

// Covers the mesh, to a millionth of a millimetre; of an empty one, the point 0.
Grid grid_of(const mesh::Mesh& mesh, int bits);

struct DracoStream {
  std::vector<std::byte> bytes;
  std::uint32_t vertices = 0;
  std::uint32_t triangles = 0;
  std::uint32_t position_id = 0;  // the attributes' ids within the stream
  std::uint32_t normal_id = 0;
  mesh::Vec3 low = {0, 0, 0};  // bounds of the decoded positions
  mesh::Vec3 high = {0, 0, 0};
};

// Consecutive triangles [begin, end).
struct Run {
  std::size_t begin = 0;
  std::size_t end = 0;
};

// Triangles that are encoded together: a run from each of some consecutive layers.
using Block = std::vector<Run>;

// Cuts the mesh into blocks of about that many triangles which are as compact as the order of the
// triangles allows, because blocks share the vertices on their seams: a layer is cut into equal
// runs, and runs of the same place in consecutive layers lie above each other. Every triangle is in
// one block. No empty blocks.
std::vector<Block> cut_blocks(const mesh::Mesh& mesh, std::size_t triangles_per_block);

// The block of all triangles.
Block whole_block(const mesh::Mesh& mesh);

// Encodes the block's triangles with the vertices they name: by edgebreaker, or for speed 10 (as
// Draco's own convention has it) and for a mesh without triangles sequentially. `normals` are those
// of the mesh's vertices, or none; a normal decodes to the same bits in every stream. Takes one
// thread. Thread safe. Throws Error kInternal when Draco refuses.
DracoStream encode_draco(const mesh::Mesh& mesh, const Block& block, const Grid& grid, int speed,
                         std::span<const mesh::Vec3> normals = {});

}  // namespace isomesh::codec
