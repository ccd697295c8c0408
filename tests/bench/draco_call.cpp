#include "tests/bench/draco_call.h"

#include <stdexcept>

#include <draco/compression/encode.h>
#include <draco/mesh/mesh.h>

namespace isomesh::bench {

std::uint64_t encode_in_one_call(std::span<const mesh::Vec3> positions,
                                 std::span<const long long> corners) {
  draco::Mesh mesh;
  mesh.set_num_points(static_cast<std::uint32_t>(positions.size()));
  draco::GeometryAttribute position;
  position.Init(draco::GeometryAttribute::POSITION, nullptr, 3, draco::DT_FLOAT32, false,
                sizeof(mesh::Vec3), 0);
  const int id = mesh.AddAttribute(position, true, static_cast<std::uint32_t>(positions.size()));
  mesh.attribute(id)->buffer()->Write(0, positions.data(), positions.size_bytes());
  mesh.SetNumFaces(corners.size() / 3);
  for (std::size_t t = 0; t < corners.size() / 3; ++t) {
    const auto point = [&](std::size_t corner) {
      return draco::PointIndex(static_cast<std::uint32_t>(corners[3 * t + corner]));
    };
    mesh.SetFace(draco::FaceIndex(static_cast<std::uint32_t>(t)), {point(0), point(1), point(2)});
  }

  constexpr int kPositionBits = 14;
  constexpr int kSpeed = 5;
  draco::Encoder encoder;
  encoder.SetSpeedOptions(kSpeed, kSpeed);
  encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, kPositionBits);
  encoder.SetEncodingMethod(draco::MESH_EDGEBREAKER_ENCODING);
  draco::EncoderBuffer buffer;
  const draco::Status status = encoder.EncodeMeshToBuffer(mesh, &buffer);
  if (!status.ok()) throw std::runtime_error("Draco: " + status.error_msg_string());
  return buffer.size();
}

}  // namespace isomesh::bench
