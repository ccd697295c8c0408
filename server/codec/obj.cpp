#include "server/codec/block_writer.h"
#include "server/codec/encode.h"
#include "server/codec/ply_obj_records.h"

namespace isomesh::codec {

std::string obj_header(const Frame& frame) {
  return "# isomesh, " + std::string(frame.unit.name) + ", " +
         std::string(letters_of(frame.space)) + '\n';
}

std::byte* write_obj_vertex(const mesh::Vec3& position, std::byte* begin) {
  char* out = reinterpret_cast<char*>(begin);
  *out++ = 'v';
  for (const float coordinate : position) {
    *out++ = ' ';
    out = write_number(coordinate, out);
  }
  *out++ = '\n';
  return reinterpret_cast<std::byte*>(out);
}

std::byte* write_obj_face(const mesh::Triangle& triangle, std::byte* begin) {
  char* out = reinterpret_cast<char*>(begin);
  *out++ = 'f';
  for (const std::uint32_t vertex : triangle) {
    *out++ = ' ';
    out = write_number(std::uint64_t{vertex} + 1, out);  // OBJ counts from 1
  }
  *out++ = '\n';
  return reinterpret_cast<std::byte*>(out);
}

void encode_obj(const mesh::Mesh& mesh, const Frame& frame, const mesh::Context& context,
                const Sink& sink) {
  context.throw_if_stopped();
  put_text(sink, obj_header(frame));
  BlockWriter writer(context, sink, mesh.positions.size() + mesh.triangles.size());
  writer.write(mesh.positions.size(), kMostObjVertexBytes, [&](std::size_t v, std::byte* out) {
    return write_obj_vertex(in_space(mesh.positions[v], frame.space), out);
  });
  writer.write(mesh.triangles.size(), kMostObjFaceBytes, [&](std::size_t t, std::byte* out) {
    return write_obj_face(mesh.triangles[t], out);
  });
}

}  // namespace isomesh::codec
