// A whole surface as arrays of a glTF buffer that hold it as it is: its floats, and 32-bit indices.
// Private to this folder.
#pragma once

#include <cstddef>
#include <span>

#include "server/codec/array_chunk.h"
#include "server/codec/draco_chunk.h"
#include "server/codec/encode.h"
#include "server/mesh/mesh.h"

namespace isomesh::codec {

// The arrays of a surface of that size, but for its bounds. The chunk has no bytes: put_plain
// writes them. Constant memory.
ArrayChunk describe_plain(std::size_t vertices, std::size_t triangles,
                          const MeshParameters& parameters);

// Writes those arrays, with distances if `data` has them, which are one for each vertex. Holds the
// normals in memory if `data` has none. Throws Error kCancelled, which is checked between pieces.
void put_plain(const mesh::Mesh& mesh, const MeshParameters& parameters, const VertexData& data,
               const mesh::Context& context, const Sink& sink);

}  // namespace isomesh::codec
