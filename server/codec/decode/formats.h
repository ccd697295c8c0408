// The decoder of each format, which decode.h tells of, and what they share; private to this folder.
// None of them looks whether positions are finite and vertices are there: decode does.
#pragma once

#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "server/codec/decode/decode.h"

namespace isomesh::codec::decoding {

using Bytes = std::span<const std::byte>;

DecodedSurface decode_drc(Bytes file, const mesh::Context& context);
DecodedSurface decode_glb(Bytes file, const mesh::Context& context);
DecodedSurface decode_stl(Bytes file, const mesh::Context& context);
DecodedSurface decode_ply(Bytes file, const mesh::Context& context);
DecodedSurface decode_obj(Bytes file, const mesh::Context& context);
DecodedSurface decode_3mf(Bytes file, const mesh::Context& context);
DecodedSurface decode_off(Bytes file, const mesh::Context& context);
DecodedSurface decode_vtk(Bytes file, const mesh::Context& context);
DecodedSurface decode_vtp(Bytes file, const mesh::Context& context);
DecodedSurface decode_gii(Bytes file, const mesh::Context& context);

// One Draco stream; of several attributes the positions are that of the id, or the first of
// positions where it is negative.
DecodedSurface decode_draco_stream(Bytes stream, int position_id);

// Throws Error kInternal: "the glb file that was written cannot be read: ...".
[[noreturn]] void refuse(MeshFormat format, const std::string& why);

// One behind the other; takes their memory. Throws Error kTooLarge.
DecodedSurface join(std::vector<DecodedSurface>&& parts, const mesh::Context& context);

// How many tasks of at most `size` elements make `count`.
constexpr std::size_t tasks_of(std::size_t count, std::size_t size) {
  return (count + size - 1) / size;
}

inline std::string_view as_text(Bytes bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// What lies at an offset, little-endian as this machine is; the caller has looked that it is there.
template <class T>
T value_at(Bytes bytes, std::size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

}  // namespace isomesh::codec::decoding
