#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>

#include <draco/compression/encode.h>
#include <draco/mesh/mesh.h>

#include "server/codec/encode.h"

namespace isomesh::codec {
namespace {

// The cube that the quantisation grid divides: the mesh's lowest corner and its longest side.
struct GridCube {
  std::array<float, 3> low = {0, 0, 0};
  float side = 0;
};

GridCube cover(const mesh::Mesh& mesh) {
  std::array<float, 3> low = mesh.positions[0];
  std::array<float, 3> high = low;
  for (const mesh::Vec3& position : mesh.positions) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], position[axis]);
      high[axis] = std::max(high[axis], position[axis]);
    }
  }
  float side = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    // Rounded up, or the highest vertex could lie outside by a rounding error.
    const float length = std::nextafter(high[axis] - low[axis], INFINITY);
    side = std::max(side, length);
  }
  return {low, side};
}

// Built face by face from arrays: Draco's soup builder would look for duplicates again.
std::unique_ptr<draco::Mesh> to_draco(const mesh::Mesh& mesh) {
  auto result = std::make_unique<draco::Mesh>();
  const auto vertices = static_cast<std::uint32_t>(mesh.positions.size());
  result->set_num_points(vertices);

  draco::GeometryAttribute position;
  position.Init(draco::GeometryAttribute::POSITION, nullptr, 3, draco::DT_FLOAT32, false,
                sizeof(mesh::Vec3), 0);
  const int id = result->AddAttribute(position, true, vertices);
  if (vertices == 0) return result;
  // One write for all: the attribute's buffer has the layout of our positions.
  result->attribute(id)->buffer()->Write(0, mesh.positions.data(), vertices * sizeof(mesh::Vec3));

  result->SetNumFaces(mesh.triangles.size());
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    result->SetFace(draco::FaceIndex(t),
                    {draco::PointIndex(a), draco::PointIndex(b), draco::PointIndex(c)});
  }
  return result;
}

}  // namespace

void encode_drc(const mesh::Mesh& mesh, const DracoParameters& parameters,
                const mesh::Context& context, const Sink& sink) {
  context.throw_if_stopped();
  if (mesh.triangles.size() > std::numeric_limits<std::uint32_t>::max()) {
    throw Error(ErrorCode::kTooLarge, "the surface has more triangles than Draco can encode");
  }
  draco::Encoder encoder;
  encoder.SetSpeedOptions(parameters.speed, parameters.speed);
  if (mesh.triangles.size() == 0) {
    // Neither edgebreaker nor quantisation has a code for nothing.
    encoder.SetEncodingMethod(draco::MESH_SEQUENTIAL_ENCODING);
  } else {
    const GridCube grid = cover(mesh);
    encoder.SetEncodingMethod(draco::MESH_EDGEBREAKER_ENCODING);
    encoder.SetAttributeExplicitQuantization(draco::GeometryAttribute::POSITION,
                                             parameters.position_bits, 3, grid.low.data(),
                                             grid.side);
  }
  draco::EncoderBuffer buffer;
  const draco::Status status = encoder.EncodeMeshToBuffer(*to_draco(mesh), &buffer);
  if (!status.ok()) {
    throw Error(ErrorCode::kInternal, "Draco: " + status.error_msg_string());
  }
  context.throw_if_stopped();
  sink(std::as_bytes(std::span(buffer.data(), buffer.size())));
  if (context.progress) context.progress(1);
}

}  // namespace isomesh::codec
