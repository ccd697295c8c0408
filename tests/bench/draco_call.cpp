#include "tests/bench/draco_call.h"

#include <stdexcept>

#include <draco/compression/decode.h>
#include <draco/compression/encode.h>
#include <draco/mesh/mesh.h>

namespace isomesh::bench {
namespace {

// vertex_of(corner) names the vertex at a corner; three corners a triangle.
template <class VertexOf>
std::string encode(std::span<const mesh::Vec3> positions, std::size_t triangles,
                   const VertexOf& vertex_of, const DracoParameters& parameters) {
  draco::Mesh mesh;
  mesh.set_num_points(static_cast<std::uint32_t>(positions.size()));
  draco::GeometryAttribute position;
  position.Init(draco::GeometryAttribute::POSITION, nullptr, 3, draco::DT_FLOAT32, false,
                sizeof(mesh::Vec3), 0);
  const int id = mesh.AddAttribute(position, true, static_cast<std::uint32_t>(positions.size()));
  mesh.attribute(id)->buffer()->Write(0, positions.data(), positions.size_bytes());
  mesh.SetNumFaces(triangles);
  for (std::size_t t = 0; t < triangles; ++t) {
    const auto point = [&](std::size_t corner) {
      return draco::PointIndex(static_cast<std::uint32_t>(vertex_of(3 * t + corner)));
    };
    mesh.SetFace(draco::FaceIndex(static_cast<std::uint32_t>(t)), {point(0), point(1), point(2)});
  }

  draco::Encoder encoder;
  encoder.SetSpeedOptions(parameters.speed, parameters.speed);
  encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, parameters.position_bits);
  encoder.SetEncodingMethod(draco::MESH_EDGEBREAKER_ENCODING);
  draco::EncoderBuffer buffer;
  const draco::Status status = encoder.EncodeMeshToBuffer(mesh, &buffer);
  if (!status.ok()) throw std::runtime_error("Draco: " + status.error_msg_string());
  return {buffer.data(), buffer.size()};
}

}  // namespace

std::uint64_t encode_in_one_call(std::span<const mesh::Vec3> positions,
                                 std::span<const long long> corners) {
  constexpr DracoParameters kDracosDefault = {.position_bits = 14, .speed = 5};
  return encode(
             positions, corners.size() / 3, [&](std::size_t corner) { return corners[corner]; },
             kDracosDefault)
      .size();
}

std::string encode_in_one_call(std::span<const mesh::Vec3> positions,
                               std::span<const mesh::Triangle> triangles,
                               const DracoParameters& parameters) {
  return encode(
      positions, triangles.size(),
      [&](std::size_t corner) { return triangles[corner / 3][corner % 3]; }, parameters);
}

std::uint64_t decode_in_one_call(std::string_view drc) {
  draco::DecoderBuffer buffer;
  buffer.Init(drc.data(), drc.size());
  draco::Decoder decoder;
  const auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
  if (!decoded.ok()) throw std::runtime_error("Draco: " + decoded.status().error_msg_string());
  return decoded.value()->num_faces();
}

}  // namespace isomesh::bench
