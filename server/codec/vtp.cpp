#include <bit>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "server/codec/block_writer.h"
#include "server/codec/encode.h"
#include "server/codec/faces.h"
#include "server/codec/provenance_json.h"
#include "server/codec/space.h"

namespace isomesh::codec {
namespace {

static_assert(std::endian::native == std::endian::little, "the VTP written here is little-endian");

// An array of text, stored as the numbers of its characters and a zero.
std::string text_array(const std::string& name, std::string_view text) {
  std::string array =
      "<Array type=\"String\" Name=\"" + name + "\" NumberOfTuples=\"1\" format=\"ascii\">";
  for (const char c : text) array += std::to_string(static_cast<unsigned char>(c)) + ' ';
  return array + "0</Array>\n";
}

// An array in the appended data: its element and its size in bytes.
class Appended {
 public:
  std::string element(std::string_view type, std::string_view name, std::string_view more,
                      std::uint64_t bytes) {
    std::string text = "<DataArray type=\"" + std::string(type) + "\" Name=\"" + std::string(name) +
                       "\" " + std::string(more) + "format=\"appended\" offset=\"" +
                       std::to_string(offset_) + "\"/>\n";
    offset_ += sizeof bytes + bytes;
    return text;
  }

 private:
  std::uint64_t offset_ = 0;
};

}  // namespace

std::optional<mesh::Topology> encode_vtp(const FileContent& content, const mesh::Context& context,
                                         const Sink& sink) {
  context.throw_if_stopped();
  const mesh::Mesh& mesh = content.mesh;
  const std::vector<FaceRun> runs = faces_of(content);
  const std::size_t vertices = mesh.positions.size();
  const std::size_t faces = count_of(runs);
  check_signed_indices(vertices, faces, content.format);
  const std::uint64_t point_bytes = vertices * sizeof(mesh::Vec3);
  const std::uint64_t corner_bytes = faces * sizeof(mesh::Triangle);
  const std::uint64_t face_bytes = faces * sizeof(std::uint32_t);
  const bool has_long_labels =
      content.labels != nullptr && label_type(*content.labels) == LabelType::kInt64;
  const std::size_t label_bytes = has_long_labels ? sizeof(std::int64_t) : sizeof(std::int32_t);
  Appended appended;
  std::string header =
      "<?xml version=\"1.0\"?>\n"
      "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n<PolyData>\n<FieldData>\n" +
      text_array("SPACE", letters_of(content.space)) +  // read by 3D Slicer
      text_array("isomesh:provenance", provenance_text(content.provenance)) +
      "</FieldData>\n<Piece NumberOfPoints=\"" + std::to_string(vertices) +
      "\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"" +
      std::to_string(faces) + "\">\n";
  header += "<Points>\n";
  header += appended.element("Float32", "Points", "NumberOfComponents=\"3\" ", point_bytes);
  header += "</Points>\n<Polys>\n";
  header += appended.element("Int32", "connectivity", "", corner_bytes);
  header += appended.element("Int32", "offsets", "", face_bytes);
  header += "</Polys>\n";
  if (content.labels != nullptr) {
    const LabelType type = label_type(*content.labels);
    const char* const name = type == LabelType::kInt64    ? "Int64"
                             : type == LabelType::kUint32 ? "UInt32"
                                                          : "Int32";
    header += "<CellData Scalars=\"label\">\n";
    header += appended.element(name, "label", "", faces * label_bytes);
    header += "</CellData>\n";
  }
  put_text(sink, header + "</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_");

  const auto begin_array = [&](std::uint64_t bytes) { sink(std::as_bytes(std::span(&bytes, 1))); };
  BlockWriter writer(context, sink, vertices + faces * (content.labels == nullptr ? 2 : 3));
  begin_array(point_bytes);
  writer.write(vertices, sizeof(mesh::Vec3), [&](std::size_t v, std::byte* out) {
    const mesh::Vec3 position = in_space(mesh.positions[v], content.space);
    std::memcpy(out, &position, sizeof position);
    return out + sizeof position;
  });
  begin_array(corner_bytes);
  for (const FaceRun& run : runs) {
    writer.write(run.count(), sizeof(mesh::Triangle), [&](std::size_t t, std::byte* out) {
      const mesh::Triangle face = run.at(t);
      std::memcpy(out, &face, sizeof face);
      return out + sizeof face;
    });
  }
  const auto write_word = [](std::uint32_t word, std::byte* out) {
    std::memcpy(out, &word, sizeof word);
    return out + sizeof word;
  };
  begin_array(face_bytes);
  writer.write(faces, sizeof(std::uint32_t), [&](std::size_t t, std::byte* out) {
    return write_word(static_cast<std::uint32_t>(3 * (t + 1)), out);  // the end of the face
  });
  if (content.labels != nullptr) {
    begin_array(faces * label_bytes);
    for (const FaceRun& run : runs) {
      const std::int64_t label = run.label();  // little-endian: its low bytes come first
      writer.write(run.count(), label_bytes, [&](std::size_t, std::byte* out) {
        std::memcpy(out, &label, label_bytes);
        return out + label_bytes;
      });
    }
  }
  put_text(sink, "\n</AppendedData>\n</VTKFile>\n");
  return std::nullopt;
}

}  // namespace isomesh::codec
