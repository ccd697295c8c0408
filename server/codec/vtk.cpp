#include <array>
#include <bit>
#include <cstring>
#include <string>
#include <vector>

#include "server/codec/block_writer.h"
#include "server/codec/encode.h"
#include "server/codec/faces.h"
#include "server/codec/space.h"

namespace isomesh::codec {
namespace {

static_assert(std::endian::native == std::endian::little, "VTK's legacy files are big-endian");

constexpr std::size_t kVertexBytes = sizeof(mesh::Vec3);
constexpr std::size_t kCellBytes = sizeof(std::uint32_t) + sizeof(mesh::Triangle);

std::byte* write_turned(std::uint32_t word, std::byte* out) {
  word = __builtin_bswap32(word);
  std::memcpy(out, &word, sizeof word);
  return out + sizeof word;
}

}  // namespace

std::optional<mesh::Topology> encode_vtk(const FileContent& content, const mesh::Context& context,
                                         const Sink& sink) {
  context.throw_if_stopped();
  const mesh::Mesh& mesh = content.mesh;
  const std::vector<FaceRun> runs = faces_of(content);
  const std::size_t vertices = mesh.positions.size();
  const std::size_t faces = count_of(runs);
  check_signed_indices(vertices, faces, content.format);
  put_text(sink, "# vtk DataFile Version 3.0\nisomesh, " +
                     unit_and_space(content.unit, content.space) +
                     "\nBINARY\nDATASET POLYDATA\nPOINTS " + std::to_string(vertices) + " float\n");
  BlockWriter writer(context, sink, vertices + faces * (content.labels == nullptr ? 1 : 2));
  writer.write(vertices, kVertexBytes, [&](std::size_t v, std::byte* out) {
    for (const float coordinate : in_space(mesh.positions[v], content.space)) {
      out = write_turned(std::bit_cast<std::uint32_t>(coordinate), out);
    }
    return out;
  });
  put_text(sink, "\nPOLYGONS " + std::to_string(faces) + ' ' + std::to_string(4 * faces) + '\n');
  for (const FaceRun& run : runs) {
    writer.write(run.count(), kCellBytes, [&](std::size_t t, std::byte* out) {
      out = write_turned(3, out);
      for (const std::uint32_t vertex : run.at(t)) out = write_turned(vertex, out);
      return out;
    });
  }
  put_text(sink, "\n");
  if (content.labels == nullptr) return std::nullopt;
  const LabelType type = label_type(*content.labels);
  put_text(sink, "CELL_DATA " + std::to_string(faces) + "\nSCALARS label " +
                     (type == LabelType::kInt64    ? "vtktypeint64"
                      : type == LabelType::kUint32 ? "unsigned_int"
                                                   : "int") +
                     " 1\nLOOKUP_TABLE default\n");
  for (const FaceRun& run : runs) {
    const auto bits = static_cast<std::uint64_t>(run.label());
    const std::size_t bytes = type == LabelType::kInt64 ? sizeof bits : sizeof bits / 2;
    writer.write(run.count(), bytes, [&](std::size_t, std::byte* out) {
      if (type == LabelType::kInt64)
        out = write_turned(static_cast<std::uint32_t>(bits >> 32), out);
      return write_turned(static_cast<std::uint32_t>(bits), out);
    });
  }
  put_text(sink, "\n");
  return std::nullopt;
}

}  // namespace isomesh::codec
