#include "tests/unit/codec/decode.h"

#include <stdexcept>

#include <draco/compression/decode.h>
#include <draco/mesh/mesh.h>

namespace isomesh::test {

DecodedMesh decode_in_process(std::string_view drc) {
  draco::DecoderBuffer buffer;
  buffer.Init(drc.data(), drc.size());
  draco::Decoder decoder;
  auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
  if (!decoded.ok()) throw std::runtime_error(decoded.status().error_msg_string());
  const draco::Mesh& mesh = *decoded.value();
  const auto* position = mesh.GetNamedAttribute(draco::GeometryAttribute::POSITION);
  DecodedMesh result;
  for (std::uint32_t point = 0; point < mesh.num_points(); ++point) {
    position->GetMappedValue(draco::PointIndex(point), result.points.emplace_back().data());
  }
  for (std::uint32_t face = 0; face < mesh.num_faces(); ++face) {
    const auto& corners = mesh.face(draco::FaceIndex(face));
    result.triangles.push_back({corners[0].value(), corners[1].value(), corners[2].value()});
  }
  return result;
}

}  // namespace isomesh::test
