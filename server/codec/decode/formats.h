// The decoder of each format, which decode.h tells of, and what they share; private to this folder.
// None of them looks whether positions are finite and vertices are there: decode does.
#pragma once

#include <string>

#include "server/codec/decode/decode.h"

namespace isomesh::codec::decoding {

using Bytes = std::span<const std::byte>;

DecodedSurface decode_drc(Bytes file);
DecodedSurface decode_glb(Bytes file, const mesh::Context& context);

// One Draco stream; of several attributes the positions are that of the id, or the first of
// positions where it is negative.
DecodedSurface decode_draco_stream(Bytes stream, int position_id);

// Throws Error kInternal: "the glb file that was written cannot be read: ...".
[[noreturn]] void refuse(MeshFormat format, const std::string& why);

}  // namespace isomesh::codec::decoding
