// Mesh -> bytes of a file format.
#pragma once

#include <cstddef>
#include <functional>
#include <span>

#include "proto/types.h"
#include "server/mesh/context.h"
#include "server/mesh/mesh.h"

namespace isomesh::codec {

// Takes the encoded bytes, in order; may throw, which ends the encoding.
using Sink = std::function<void(std::span<const std::byte>)>;

// One Draco stream of the whole mesh (edgebreaker connectivity), millimetres in LPS. Positions are
// quantised to draco.position_bits bits on a cubic grid that covers the mesh's bounds exactly, so
// that a decoded vertex is within half a grid step of its place along each axis. The stream keeps
// the number of vertices and triangles. Thread safe. Throws Error kInternal when Draco refuses, and
// kCancelled, looked at before and after Draco's one call.
void encode_drc(const mesh::Mesh& mesh, const DracoParameters& draco,
                const mesh::Context& context, const Sink& sink);

// Binary STL, millimetres in LPS, normals from the winding. Throws Error kTooLarge beyond 2^32 - 1
// triangles, and kCancelled.
void encode_stl(const mesh::Mesh& mesh, const mesh::Context& context, const Sink& sink);

// Dispatches on the format. Throws Error kInvalidParameter for a format that is not supported.
void encode(const mesh::Mesh& mesh, MeshFormat format, const DracoParameters& draco,
            const mesh::Context& context, const Sink& sink);

// True for the formats that `encode` writes.
bool can_encode(MeshFormat format);

// The media type of a mesh file; application/octet-stream where none is registered.
std::string_view media_type(MeshFormat format);

}  // namespace isomesh::codec
