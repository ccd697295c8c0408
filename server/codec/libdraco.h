// Encodes with libdraco what our own encoder does not support. Private to this folder.
#pragma once

#include <span>

#include "server/codec/draco_chunk.h"

namespace isomesh::codec {

struct Arrays {
  std::span<const mesh::Vec3> positions;
  VertexData data;
  std::span<const mesh::Triangle> triangles;
};

// Encodes by edgebreaker, or sequentially: for speed 10, as Draco does, and if there is no triangle
// or one that repeats a vertex. Vertex data decode to the same bits in every stream. Fills all of
// the stream except its bounds. Occupies one thread until it is done. Thread safe. Throws Error
// kInternal if Draco fails.
DracoStream encode_with_libdraco(const Arrays& arrays, const Grid& grid, int speed);

}  // namespace isomesh::codec
