#include <bit>
#include <cstring>
#include <string>

#include "server/codec/block_writer.h"
#include "server/codec/encode.h"
#include "server/codec/ply_obj_records.h"

namespace isomesh::codec {

static_assert(std::endian::native == std::endian::little, "the PLY written here is little-endian");

std::string ply_header(const Frame& frame, std::size_t vertices, std::size_t faces,
                       std::string_view of_faces) {
  return "ply\nformat binary_little_endian 1.0\ncomment isomesh, " + std::string(frame.unit.name) +
         ", " + std::string(letters_of(frame.space)) + "\nelement vertex " +
         std::to_string(vertices) +
         "\nproperty float x\nproperty float y\nproperty float z\nelement face " +
         std::to_string(faces) + "\nproperty list uchar uint vertex_indices\n" +
         std::string(of_faces) + "end_header\n";
}

std::byte* write_ply_vertex(const mesh::Vec3& position, std::byte* out) {
  std::memcpy(out, &position, kPlyVertexBytes);
  return out + kPlyVertexBytes;
}

std::byte* write_ply_face(const mesh::Triangle& triangle, std::byte* out) {
  *out = std::byte{3};
  std::memcpy(out + 1, &triangle, sizeof triangle);
  return out + kPlyFaceBytes;
}

void encode_ply(const mesh::Mesh& mesh, const Frame& frame, const mesh::Context& context,
                const Sink& sink) {
  context.throw_if_stopped();
  put_text(sink, ply_header(frame, mesh.positions.size(), mesh.triangles.size(), ""));
  BlockWriter writer(context, sink, mesh.positions.size() + mesh.triangles.size());
  writer.write(mesh.positions.size(), kPlyVertexBytes, [&](std::size_t v, std::byte* out) {
    return write_ply_vertex(in_space(mesh.positions[v], frame.space), out);
  });
  writer.write(mesh.triangles.size(), kPlyFaceBytes, [&](std::size_t t, std::byte* out) {
    return write_ply_face(mesh.triangles[t], out);
  });
}

}  // namespace isomesh::codec
