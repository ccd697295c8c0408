#include <algorithm>

#include <draco/compression/decode.h>
#include <draco/mesh/mesh.h>

#include "server/codec/decode/decoders.h"

namespace isomesh::codec::decoding {
namespace {

void copy_positions(const draco::PointAttribute& attribute, std::size_t points,
                    mesh::Buffer<mesh::Vec3>& positions) {
  positions.resize_for_overwrite(points);
  const bool is_in_order = attribute.is_mapping_identity() &&
                           attribute.byte_stride() == sizeof(mesh::Vec3) &&
                           attribute.size() >= points;
  if (is_in_order && points > 0) {
    attribute.buffer()->Read(attribute.byte_offset(), positions.data(),
                             points * sizeof(mesh::Vec3));
    return;
  }
  for (std::uint32_t point = 0; point < points; ++point) {
    attribute.GetMappedValue(draco::PointIndex(point), positions[point].data());
  }
}

}  // namespace

DecodedSurface decode_draco_stream(Bytes stream, int position_id) {
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(stream.data()), stream.size());
  draco::Decoder decoder;
  const auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
  if (!decoded.ok()) {
    refuse(MeshFormat::kDrc, "libdraco reports: " + decoded.status().error_msg_string());
  }
  const draco::Mesh& mesh = *decoded.value();
  const draco::PointAttribute* positions =
      position_id < 0 ? mesh.GetNamedAttribute(draco::GeometryAttribute::POSITION)
                      : mesh.GetAttributeByUniqueId(static_cast<std::uint32_t>(position_id));
  if (positions == nullptr || positions->num_components() != 3 ||
      positions->data_type() != draco::DT_FLOAT32) {
    refuse(MeshFormat::kDrc, "it has no positions of three floats");
  }
  DecodedSurface surface;
  copy_positions(*positions, mesh.num_points(), surface.positions);
  surface.triangles.resize_for_overwrite(mesh.num_faces());
  for (std::uint32_t t = 0; t < mesh.num_faces(); ++t) {
    const auto& corners = mesh.face(draco::FaceIndex(t));
    surface.triangles[t] = {corners[0].value(), corners[1].value(), corners[2].value()};
  }
  return surface;
}

DecodedSurface decode_drc(Bytes file, const mesh::Context& /*context*/) {
  constexpr int kFirstOfPositions = -1;
  return decode_draco_stream(file, kFirstOfPositions);
}

}  // namespace isomesh::codec::decoding
