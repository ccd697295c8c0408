#include <string>
#include <vector>

#include "server/codec/block_writer.h"
#include "server/codec/encode.h"
#include "server/codec/faces.h"
#include "server/codec/label_titles.h"
#include "server/codec/number_text.h"
#include "server/codec/space.h"

namespace isomesh::codec {
namespace {

constexpr std::size_t kMostObjVertexBytes = 2 + 3 * (1 + kMostFloatBytes);
constexpr std::size_t kMostObjFaceBytes = 2 + 3 * (1 + kMostIndexBytes);

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

}  // namespace

std::optional<mesh::Topology> encode_obj(const FileContent& content, const mesh::Context& context,
                                         const Sink& sink) {
  context.throw_if_stopped();
  const mesh::Mesh& mesh = content.mesh;
  put_text(sink, "# isomesh, " + std::string(content.unit.name) + ", " +
                     std::string(letters_of(content.space)) + '\n');
  const std::vector<FaceRun> runs = faces_of(content);
  BlockWriter writer(context, sink, mesh.positions.size() + count_of(runs));
  writer.write(mesh.positions.size(), kMostObjVertexBytes, [&](std::size_t v, std::byte* out) {
    return write_obj_vertex(in_space(mesh.positions[v], content.space), out);
  });
  ObjGroups groups;
  for (std::size_t n = 0; n < runs.size(); ++n) {
    if (content.labels != nullptr) {
      const std::string group = groups.of(content.labels->labels[n]);
      put_text(sink, "g " + group + "\nusemtl " + group + '\n');
    }
    writer.write(runs[n].count(), kMostObjFaceBytes,
                 [&](std::size_t t, std::byte* out) { return write_obj_face(runs[n].at(t), out); });
  }
  return std::nullopt;
}

}  // namespace isomesh::codec
