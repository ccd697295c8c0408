#include <string>

#include "server/codec/block_writer.h"
#include "server/codec/encode.h"
#include "server/codec/number_text.h"
#include "server/codec/space.h"

namespace isomesh::codec {
namespace {

constexpr std::size_t kMostVertexLineBytes = 3 * (kMostFloatBytes + 1);
constexpr std::size_t kMostFaceBytes = 2 + 3 * (kMostIndexBytes + 1);

template <class Number>
char* write_numbers(Number a, Number b, Number c, char* out) {
  out = write_number(a, out);
  *out++ = ' ';
  out = write_number(b, out);
  *out++ = ' ';
  out = write_number(c, out);
  *out++ = '\n';
  return out;
}

}  // namespace

std::optional<mesh::Topology> encode_off(const FileContent& content, const mesh::Context& context,
                                         const Sink& sink) {
  context.throw_if_stopped();
  const mesh::Mesh& mesh = content.mesh;
  put_text(sink, "OFF\n" + std::to_string(mesh.positions.size()) + ' ' +
                     std::to_string(mesh.triangles.size()) + " 0\n");
  BlockWriter writer(context, sink, mesh.positions.size() + mesh.triangles.size());
  writer.write(mesh.positions.size(), kMostVertexLineBytes, [&](std::size_t v, std::byte* out) {
    const auto& [x, y, z] = in_space(mesh.positions[v], content.space);
    return reinterpret_cast<std::byte*>(write_numbers(x, y, z, reinterpret_cast<char*>(out)));
  });
  writer.write(mesh.triangles.size(), kMostFaceBytes, [&](std::size_t t, std::byte* out) {
    const auto& [a, b, c] = mesh.triangles[t];
    char* const text = write_text("3 ", reinterpret_cast<char*>(out));
    return reinterpret_cast<std::byte*>(
        write_numbers(std::uint64_t{a}, std::uint64_t{b}, std::uint64_t{c}, text));
  });
  // A comment before the last face stops NiiVue, gmsh, meshio or trimesh.
  put_text(sink, "# isomesh, " + unit_and_space(content.unit, content.space) + '\n');
  return std::nullopt;
}

}  // namespace isomesh::codec
