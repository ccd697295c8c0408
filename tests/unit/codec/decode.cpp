#include "tests/unit/codec/decode.h"

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include <draco/compression/decode.h>
#include <draco/mesh/mesh.h>

namespace isomesh::test {
namespace {

std::unique_ptr<draco::Mesh> decoded(std::string_view drc) {
  draco::DecoderBuffer buffer;
  buffer.Init(drc.data(), drc.size());
  draco::Decoder decoder;
  auto mesh = decoder.DecodeMeshFromBuffer(&buffer);
  if (!mesh.ok()) throw std::runtime_error(mesh.status().error_msg_string());
  return std::move(mesh).value();
}

}  // namespace

DecodedMesh decode_in_process(std::string_view drc) {
  const auto held = decoded(drc);
  const draco::Mesh& mesh = *held;
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

std::vector<std::vector<float>> attributes_in_process(std::string_view drc) {
  const auto mesh = decoded(drc);
  std::vector<std::vector<float>> attributes;
  for (std::int32_t id = 0; id < mesh->num_attributes(); ++id) {
    const draco::PointAttribute& attribute = *mesh->attribute(id);
    const auto components = static_cast<std::size_t>(attribute.num_components());
    std::vector<float>& numbers = attributes.emplace_back(components * mesh->num_points());
    for (std::uint32_t point = 0; point < mesh->num_points(); ++point) {
      attribute.GetMappedValue(draco::PointIndex(point), &numbers[point * components]);
    }
  }
  return attributes;
}

}  // namespace isomesh::test
