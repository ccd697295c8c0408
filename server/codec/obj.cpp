#include <string>
#include <string_view>

#include "server/codec/block_writer.h"
#include "server/codec/encode.h"
#include "server/codec/faces.h"
#include "server/codec/label_titles.h"
#include "server/codec/number_text.h"
#include "server/codec/space.h"
#include "server/mesh/labels/label_surface.h"

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

std::byte* write_obj_face(const mesh::Triangle& triangle, std::uint64_t first, std::byte* begin) {
  char* out = reinterpret_cast<char*>(begin);
  *out++ = 'f';
  for (const std::uint32_t vertex : triangle) {
    *out++ = ' ';
    out = write_number(first + vertex, out);
  }
  *out++ = '\n';
  return reinterpret_cast<std::byte*>(out);
}

// Writes surfaces one after the other. OBJ counts the vertices of the whole file, from 1.
class ObjWriter {
 public:
  ObjWriter(const FileContent& content, const mesh::Context& context, const Sink& sink,
            std::size_t records)
      : space_(content.space), sink_(sink), writer_(context, sink, records) {}

  // `attributes` are the lines between the vertices and the faces.
  void add(const mesh::Mesh& mesh, std::string_view attributes) {
    writer_.write(mesh.positions.size(), kMostObjVertexBytes, [&](std::size_t v, std::byte* out) {
      return write_obj_vertex(in_space(mesh.positions[v], space_), out);
    });
    put_text(sink_, attributes);
    writer_.write(mesh.triangles.size(), kMostObjFaceBytes, [&](std::size_t t, std::byte* out) {
      return write_obj_face(mesh.triangles[t], first_, out);
    });
    first_ += mesh.positions.size();
  }

 private:
  const Space space_;
  const Sink& sink_;
  BlockWriter writer_;
  std::uint64_t first_ = 1;
};

void encode_obj_labels(const LabelledSurface& surface, const FileContent& content,
                       const mesh::Context& context, const Sink& sink) {
  put_text(sink, "mtllib " + std::string(kMaterialsName) + '\n');
  std::uint64_t records = count_of(faces_of(content));
  for (const LabelSummary& label : surface.labels) records += label.vertices;
  ObjWriter writer(content, context, sink, records);
  ObjGroups groups;
  for (std::size_t n = 0; n < surface.labels.size(); ++n) {
    const std::string group = groups.of(surface.labels[n]);
    const mesh::Mesh& mesh = surface.surfaces[n].mesh;
    if (mesh.triangles.size() == 0) continue;
    put_text(sink, "o " + group + '\n');
    writer.add(mesh, "g " + group + "\nusemtl " + group + '\n');
  }
}

}  // namespace

std::optional<mesh::Topology> encode_obj(const FileContent& content, const mesh::Context& context,
                                         const Sink& sink) {
  context.throw_if_stopped();
  put_text(sink, "# isomesh, " + unit_and_space(content.unit, content.space) + '\n');
  if (content.labels != nullptr) {
    encode_obj_labels(*content.labels, content, context, sink);
    return std::nullopt;
  }
  const mesh::Mesh& mesh = content.mesh;
  ObjWriter(content, context, sink, mesh.positions.size() + mesh.triangles.size()).add(mesh, "");
  return std::nullopt;
}

}  // namespace isomesh::codec
