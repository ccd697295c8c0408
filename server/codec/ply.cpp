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

static_assert(std::endian::native == std::endian::little, "the PLY written here is little-endian");

constexpr std::size_t kFaceBytes = 1 + sizeof(mesh::Triangle);

bool are_numbered(const FileContent& content) {
  return content.labels != nullptr && label_type(*content.labels) == LabelType::kInt64;
}

// PLY has no integers of 64 bits. Faces of such labels have numbers from 1, and comments tell which
// label each stands for.
std::string numbered_labels(const FileContent& content) {
  std::string comments;
  if (!are_numbered(content)) return comments;
  std::size_t number = 0;
  for (const LabelSummary& label : content.labels->labels) {
    comments +=
        "comment label " + std::to_string(++number) + " is " + std::to_string(label.label) + '\n';
  }
  return comments;
}

std::string ply_header(const FileContent& content, std::size_t faces) {
  std::string header = "ply\nformat binary_little_endian 1.0\ncomment isomesh, " +
                       std::string(content.unit.name) + ", " +
                       std::string(letters_of(content.space)) + '\n' + numbered_labels(content) +
                       "element vertex " + std::to_string(content.mesh.positions.size()) +
                       "\nproperty float x\nproperty float y\nproperty float z\nelement face " +
                       std::to_string(faces) + "\nproperty list uchar uint vertex_indices\n";
  if (content.labels != nullptr) {
    header += label_type(*content.labels) == LabelType::kInt32 ? "property int label\n"
                                                               : "property uint label\n";
  }
  return header + "end_header\n";
}

}  // namespace

std::optional<mesh::Topology> encode_ply(const FileContent& content, const mesh::Context& context,
                                         const Sink& sink) {
  context.throw_if_stopped();
  const mesh::Mesh& mesh = content.mesh;
  const std::vector<FaceRun> runs = faces_of(content);
  const std::size_t faces = count_of(runs);
  put_text(sink, ply_header(content, faces));
  BlockWriter writer(context, sink, mesh.positions.size() + faces);
  writer.write(mesh.positions.size(), sizeof(mesh::Vec3), [&](std::size_t v, std::byte* out) {
    const mesh::Vec3 position = in_space(mesh.positions[v], content.space);
    std::memcpy(out, &position, sizeof position);
    return out + sizeof position;
  });
  const std::size_t label_bytes = content.labels == nullptr ? 0 : sizeof(std::uint32_t);
  const bool is_numbered = are_numbered(content);
  std::uint32_t number = 0;
  for (const FaceRun& run : runs) {
    const auto label = is_numbered ? ++number : static_cast<std::uint32_t>(run.label());
    writer.write(run.count(), kFaceBytes + label_bytes, [&](std::size_t t, std::byte* out) {
      const mesh::Triangle face = run.at(t);
      *out = std::byte{3};
      std::memcpy(out + 1, &face, sizeof face);
      std::memcpy(out + kFaceBytes, &label, label_bytes);
      return out + kFaceBytes + label_bytes;
    });
  }
  return std::nullopt;
}

}  // namespace isomesh::codec
