#include <bit>
#include <cstring>
#include <string>

#include "server/codec/block_writer.h"
#include "server/codec/encode.h"

namespace isomesh::codec {
namespace {

static_assert(std::endian::native == std::endian::little, "the PLY written here is little-endian");

constexpr std::size_t kFaceBytes = 1 + sizeof(mesh::Triangle);

std::string header_of(const mesh::Mesh& mesh) {
  return "ply\nformat binary_little_endian 1.0\ncomment isomesh, millimetres, LPS\nelement "
         "vertex " +
         std::to_string(mesh.positions.size()) +
         "\nproperty float x\nproperty float y\nproperty float z\nelement face " +
         std::to_string(mesh.triangles.size()) +
         "\nproperty list uchar uint vertex_indices\nend_header\n";
}

}  // namespace

void encode_ply(const mesh::Mesh& mesh, const mesh::Context& context, const Sink& sink) {
  context.throw_if_stopped();
  const std::string header = header_of(mesh);
  sink(std::as_bytes(std::span(header)));
  BlockWriter writer(context, sink, mesh.positions.size() + mesh.triangles.size());
  writer.write(mesh.positions.size(), sizeof(mesh::Vec3), [&](std::size_t v, std::byte* out) {
    std::memcpy(out, &mesh.positions[v], sizeof(mesh::Vec3));
    return out + sizeof(mesh::Vec3);
  });
  writer.write(mesh.triangles.size(), kFaceBytes, [&](std::size_t t, std::byte* out) {
    *out = std::byte{3};
    std::memcpy(out + 1, &mesh.triangles[t], sizeof(mesh::Triangle));
    return out + kFaceBytes;
  });
}

}  // namespace isomesh::codec
