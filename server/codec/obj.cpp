#include <charconv>
#include <string_view>

#include "server/codec/block_writer.h"
#include "server/codec/encode.h"

namespace isomesh::codec {
namespace {

constexpr std::string_view kHeader = "# isomesh, millimetres, LPS\n";
// Without an exponent, which some readers do not know: a sign, up to 39 digits before the point, or
// a point and up to 54 digits behind it.
constexpr std::size_t kMostFloatBytes = 64;
constexpr std::size_t kMostIndexBytes = 10;

// Space for `most` more bytes is there.
template <class... Format>
char* append_number(char* out, std::size_t most, Format... number) {
  *out++ = ' ';
  return std::to_chars(out, out + most, number...).ptr;
}

}  // namespace

void encode_obj(const mesh::Mesh& mesh, const mesh::Context& context, const Sink& sink) {
  context.throw_if_stopped();
  sink(std::as_bytes(std::span(kHeader)));
  BlockWriter writer(context, sink, mesh.positions.size() + mesh.triangles.size());
  constexpr std::size_t kMostVertexBytes = 2 + 3 * (1 + kMostFloatBytes);
  writer.write(mesh.positions.size(), kMostVertexBytes, [&](std::size_t v, std::byte* begin) {
    char* out = reinterpret_cast<char*>(begin);
    *out++ = 'v';
    for (const float coordinate : mesh.positions[v]) {
      // The shortest text that reads as the same number.
      out = append_number(out, kMostFloatBytes, coordinate, std::chars_format::fixed);
    }
    *out++ = '\n';
    return reinterpret_cast<std::byte*>(out);
  });
  constexpr std::size_t kMostFaceBytes = 2 + 3 * (1 + kMostIndexBytes);
  writer.write(mesh.triangles.size(), kMostFaceBytes, [&](std::size_t t, std::byte* begin) {
    char* out = reinterpret_cast<char*>(begin);
    *out++ = 'f';
    for (const std::uint32_t vertex : mesh.triangles[t]) {
      out = append_number(out, kMostIndexBytes, std::uint64_t{vertex} + 1);  // OBJ counts from 1
    }
    *out++ = '\n';
    return reinterpret_cast<std::byte*>(out);
  });
}

}  // namespace isomesh::codec
