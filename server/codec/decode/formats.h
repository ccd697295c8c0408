// The decoders behind decode.h, and shared helpers. Private to this folder. The decoders do not
// check that positions are finite and vertex indices valid: decode does.
#pragma once

#include <string>

#include "server/codec/decode/decode.h"

namespace isomesh::codec::decoding {

using Bytes = std::span<const std::byte>;

DecodedSurface decode_drc(Bytes file);
DecodedSurface decode_glb(Bytes file, const mesh::Context& context);

// Decodes one Draco stream. `position_id` selects the attribute of positions; if negative, the
// first one.
DecodedSurface decode_draco_stream(Bytes stream, int position_id);

// Throws Error kInternal: "the glb file that was written cannot be read: ...".
[[noreturn]] void refuse(MeshFormat format, const std::string& why);

}  // namespace isomesh::codec::decoding
