#include <array>
#include <bit>
#include <cstring>
#include <string>
#include <vector>

#include "server/codec/block_writer.h"
#include "server/codec/encode.h"
#include "server/codec/encode_labels.h"
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

void write_file(const mesh::Mesh& mesh, const std::vector<FaceRun>& runs, const char* label_type,
                const Frame& frame, const mesh::Context& context, const Sink& sink) {
  context.throw_if_stopped();
  const std::size_t vertices = mesh.positions.size();
  const std::size_t faces = count_of(runs);
  check_signed_indices(vertices, faces, MeshFormat::kVtk);
  // 3D Slicer reads the space from the title in the second line.
  put_text(sink, "# vtk DataFile Version 3.0\nisomesh, " + std::string(frame.unit.name) +
                     ", SPACE=" + std::string(letters_of(frame.space)) +
                     "\nBINARY\nDATASET POLYDATA\nPOINTS " + std::to_string(vertices) + " float\n");
  BlockWriter writer(context, sink, vertices + faces * (label_type == nullptr ? 1 : 2));
  writer.write(vertices, kVertexBytes, [&](std::size_t v, std::byte* out) {
    for (const float coordinate : in_space(mesh.positions[v], frame.space)) {
      out = write_turned(std::bit_cast<std::uint32_t>(coordinate), out);
    }
    return out;
  });
  put_text(sink, "\nPOLYGONS " + std::to_string(faces) + ' ' + std::to_string(4 * faces) + '\n');
  for (const FaceRun& run : runs) {
    writer.write(run.count, kCellBytes, [&](std::size_t t, std::byte* out) {
      out = write_turned(3, out);
      for (const std::uint32_t vertex : run.at(t)) out = write_turned(vertex, out);
      return out;
    });
  }
  put_text(sink, "\n");
  if (label_type == nullptr) return;
  put_text(sink, "CELL_DATA " + std::to_string(faces) + "\nSCALARS label " + label_type +
                     " 1\nLOOKUP_TABLE default\n");
  for (const FaceRun& run : runs) {
    writer.write(run.count, sizeof run.label,
                 [&](std::size_t, std::byte* out) { return write_turned(run.label, out); });
  }
  put_text(sink, "\n");
}

}  // namespace

void encode_vtk(const mesh::Mesh& mesh, const Frame& frame, const mesh::Context& context,
                const Sink& sink) {
  write_file(mesh, faces_of(mesh), nullptr, frame, context, sink);
}

void encode_labels_vtk(const LabelledSurface& surface, const Frame& frame,
                       const mesh::Context& context, const Sink& sink) {
  write_file(surface.walls.mesh, faces_of(surface),
             has_wide_labels(surface) ? "unsigned_int" : "int", frame, context, sink);
}

}  // namespace isomesh::codec
