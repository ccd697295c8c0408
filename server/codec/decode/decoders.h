// The decoders of the table of formats, and shared helpers. Private to codec. Decoders need the
// memory of the surface, twice if blocks are joined. Thread safe. They throw Error kInternal if the
// file is not as our encoders write it.
#pragma once

#include <string>

#include "server/codec/decode/decode.h"

namespace isomesh::codec::decoding {

using Bytes = std::span<const std::byte>;

// With libdraco.
DecodedSurface decode_drc(Bytes file, const mesh::Context& context);
// With libdraco and meshoptimizer: the finest level of the default scene, its blocks joined.
DecodedSurface decode_glb(Bytes file, const mesh::Context& context);

// Throws Error kInternal unless all positions are finite and all vertex indices valid; kCancelled.
void check(const DecodedSurface& surface, MeshFormat format, const mesh::Context& context);

// Decodes one Draco stream. `position_id` selects the attribute of positions; if negative, the
// first one.
DecodedSurface decode_draco_stream(Bytes stream, int position_id);

// Throws Error kInternal: "the glb file that was written cannot be read: ...".
[[noreturn]] void refuse(MeshFormat format, const std::string& why);

}  // namespace isomesh::codec::decoding
