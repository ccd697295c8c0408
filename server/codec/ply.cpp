#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "proto/error.h"
#include "server/codec/block_writer.h"
#include "server/codec/encode.h"
#include "server/codec/faces.h"
#include "server/codec/label_titles.h"
#include "server/codec/space.h"
#include "server/mesh/labels/label_surface.h"

namespace isomesh::codec {
namespace {

static_assert(std::endian::native == std::endian::little, "the PLY written here is little-endian");

constexpr std::size_t kPlyFaceBytes = 1 + sizeof(mesh::Triangle);

std::byte* write_ply_face(const mesh::Triangle& face, std::byte* out) {
  *out = std::byte{3};
  std::memcpy(out + 1, &face, sizeof face);
  return out + kPlyFaceBytes;
}

std::string ply_header(const FileContent& content, const std::string& comments,
                       std::size_t vertices, const std::string& properties, std::size_t faces) {
  return "ply\nformat binary_little_endian 1.0\ncomment isomesh, " +
         unit_and_space(content.unit, content.space) + '\n' + comments + "element vertex " +
         std::to_string(vertices) + "\nproperty float x\nproperty float y\nproperty float z\n" +
         properties + "element face " + std::to_string(faces) +
         "\nproperty list uchar uint vertex_indices\nend_header\n";
}

// A vertex of a label's own surface.
struct LabelVertex {
  static constexpr std::size_t kBytes = sizeof(mesh::Vec3) + 3 + sizeof(std::uint32_t);

  std::array<std::uint8_t, 3> color;
  std::uint32_t label = 0;

  std::byte* write(const mesh::Vec3& position, std::byte* out) const {
    std::memcpy(out, &position, sizeof position);
    out += sizeof position;
    std::memcpy(out, color.data(), color.size());
    out += color.size();
    std::memcpy(out, &label, sizeof label);
    return out + sizeof label;
  }
};

std::array<std::uint8_t, 3> color_in_bytes(const LabelSummary& label) {
  std::array<std::uint8_t, 3> bytes;
  std::ranges::transform(color_of(label), bytes.begin(), [](double channel) {
    return static_cast<std::uint8_t>(std::lround(channel * 255));
  });
  return bytes;
}

// PLY has no integers of 64 bits. Such labels have numbers from 1, and comments tell which label
// each stands for.
class LabelValues {
 public:
  explicit LabelValues(const LabelledSurface& surface)
      : labels_(surface.labels), type_(label_type(surface)) {}

  std::string comments() const {
    std::string comments;
    if (type_ != LabelType::kInt64) return comments;
    for (std::size_t n = 0; n < labels_.size(); ++n) {
      comments += "comment label " + std::to_string(n + 1) + " is " +
                  std::to_string(labels_[n].label) + '\n';
    }
    return comments;
  }
  std::string property() const {
    return type_ == LabelType::kInt32 ? "property int label\n" : "property uint label\n";
  }
  std::uint32_t of(std::size_t n) const {
    return static_cast<std::uint32_t>(type_ == LabelType::kInt64 ? static_cast<std::int64_t>(n + 1)
                                                                 : labels_[n].label);
  }

 private:
  std::span<const LabelSummary> labels_;
  LabelType type_;
};

// Labels are at vertices, because some readers fail at any property of faces beside the list.
void encode_ply_labels(const LabelledSurface& surface, const FileContent& content,
                       const mesh::Context& context, const Sink& sink) {
  std::uint64_t vertices = 0;
  for (const LabelSummary& label : surface.labels) vertices += label.vertices;
  if (vertices > std::numeric_limits<std::uint32_t>::max()) {
    throw Error(ErrorCode::kTooLarge, "the labels have more vertices than a PLY file can number");
  }
  const std::size_t faces = count_of(faces_of(content));
  const LabelValues values(surface);
  // meshio reads binary uchar as signed, and uint8, its other name, as it is.
  put_text(sink, ply_header(content, values.comments(), vertices,
                            "property uint8 red\nproperty uint8 green\nproperty uint8 blue\n" +
                                values.property(),
                            faces));
  BlockWriter writer(context, sink, vertices + faces);
  for (std::size_t n = 0; n < surface.labels.size(); ++n) {
    const LabelVertex vertex = {color_in_bytes(surface.labels[n]), values.of(n)};
    const auto& positions = surface.surfaces[n].mesh.positions;
    if (positions.size() != surface.labels[n].vertices) {
      throw Error(ErrorCode::kInternal, "a label's surface has another number of vertices");
    }
    writer.write(positions.size(), LabelVertex::kBytes, [&](std::size_t v, std::byte* out) {
      return vertex.write(in_space(positions[v], content.space), out);
    });
  }
  std::uint32_t first = 0;
  for (const mesh::LabelSurface& own : surface.surfaces) {
    const mesh::Mesh& mesh = own.mesh;
    writer.write(mesh.triangles.size(), kPlyFaceBytes, [&](std::size_t t, std::byte* out) {
      const auto& [a, b, c] = mesh.triangles[t];
      return write_ply_face({first + a, first + b, first + c}, out);
    });
    first += static_cast<std::uint32_t>(mesh.positions.size());
  }
}

}  // namespace

std::optional<mesh::Topology> encode_ply(const FileContent& content, const mesh::Context& context,
                                         const Sink& sink) {
  context.throw_if_stopped();
  if (content.labels != nullptr) {
    encode_ply_labels(*content.labels, content, context, sink);
    return std::nullopt;
  }
  const mesh::Mesh& mesh = content.mesh;
  put_text(sink, ply_header(content, "", mesh.positions.size(), "", mesh.triangles.size()));
  BlockWriter writer(context, sink, mesh.positions.size() + mesh.triangles.size());
  writer.write(mesh.positions.size(), sizeof(mesh::Vec3), [&](std::size_t v, std::byte* out) {
    const mesh::Vec3 position = in_space(mesh.positions[v], content.space);
    std::memcpy(out, &position, sizeof position);
    return out + sizeof position;
  });
  writer.write(mesh.triangles.size(), kPlyFaceBytes, [&](std::size_t t, std::byte* out) {
    return write_ply_face(mesh.triangles[t], out);
  });
  return std::nullopt;
}

}  // namespace isomesh::codec
