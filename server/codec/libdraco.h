// What our own encoder does not cover goes to libdraco; private to this folder.
#pragma once

#include <span>

#include "server/codec/draco_chunk.h"

namespace isomesh::codec {

// Triangles with the vertices they name, as arrays.
struct Arrays {
  std::span<const mesh::Vec3> positions;
  VertexData data;
  std::span<const mesh::Triangle> triangles;
};

// Encodes by edgebreaker, or sequentially: for speed 10, as Draco's own convention has it, and
// where there is no triangle or one that repeats a vertex. The vertices' data decode to the
// same bits in every stream. Fills all of the stream but its bounds. Takes one thread, which it
// never gives back before it is done. Thread safe. Throws Error kInternal when Draco refuses.
DracoStream encode_with_libdraco(const Arrays& arrays, const Grid& grid, int speed);

}  // namespace isomesh::codec
