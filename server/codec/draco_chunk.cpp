#include "server/codec/draco_chunk.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <span>

#include <draco/compression/encode.h>
#include <draco/core/quantization_utils.h>
#include <draco/mesh/mesh.h>

#include "proto/error.h"

namespace isomesh::codec {
namespace {

constexpr int kSequentialSpeed = 10;

struct Bounds {
  mesh::Vec3 low = {0, 0, 0};
  mesh::Vec3 high = {0, 0, 0};
};

Bounds bounds_of(std::span<const mesh::Vec3> positions) {
  if (positions.empty()) return {};
  Bounds bounds = {positions[0], positions[0]};
  for (const mesh::Vec3& position : positions) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      bounds.low[axis] = std::min(bounds.low[axis], position[axis]);
      bounds.high[axis] = std::max(bounds.high[axis], position[axis]);
    }
  }
  return bounds;
}

// Part of a mesh with vertices numbered anew, in the order in which its triangles name them.
struct Part {
  std::vector<mesh::Vec3> positions;
  std::vector<mesh::Triangle> triangles;
};

Part part_of(const mesh::Mesh& mesh, std::size_t begin, std::size_t end) {
  constexpr std::uint32_t kUnnamed = std::numeric_limits<std::uint32_t>::max();
  const std::span triangles = mesh.triangles.span().subspan(begin, end - begin);
  std::uint32_t low = kUnnamed;
  std::uint32_t high = 0;
  for (const mesh::Triangle& triangle : triangles) {
    for (const std::uint32_t vertex : triangle) {
      low = std::min(low, vertex);
      high = std::max(high, vertex);
    }
  }
  // Triangles of neighbouring layers name vertices of neighbouring layers, so the range is short.
  std::vector<std::uint32_t> number(std::size_t{high} - low + 1, kUnnamed);
  Part part;
  part.positions.reserve(triangles.size() / 2);
  part.triangles.reserve(triangles.size());
  for (const mesh::Triangle& triangle : triangles) {
    mesh::Triangle& renumbered = part.triangles.emplace_back();
    for (std::size_t corner = 0; corner < 3; ++corner) {
      std::uint32_t& vertex = number[triangle[corner] - low];
      if (vertex == kUnnamed) {
        vertex = static_cast<std::uint32_t>(part.positions.size());
        part.positions.push_back(mesh.positions[triangle[corner]]);
      }
      renumbered[corner] = vertex;
    }
  }
  return part;
}

// Built from arrays: Draco's soup builder would look for duplicates again.
std::unique_ptr<draco::Mesh> to_draco(std::span<const mesh::Vec3> positions,
                                      std::span<const mesh::Triangle> triangles) {
  auto result = std::make_unique<draco::Mesh>();
  const auto vertices = static_cast<std::uint32_t>(positions.size());
  result->set_num_points(vertices);
  draco::GeometryAttribute position;
  position.Init(draco::GeometryAttribute::POSITION, nullptr, 3, draco::DT_FLOAT32, false,
                sizeof(mesh::Vec3), 0);
  draco::PointAttribute* attribute =
      result->attribute(result->AddAttribute(position, true, vertices));
  // One write for all: the attribute's buffer has the layout of our positions.
  if (vertices > 0) attribute->buffer()->Write(0, positions.data(), positions.size_bytes());

  result->SetNumFaces(triangles.size());
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    const auto& [a, b, c] = triangles[t];
    result->SetFace(draco::FaceIndex(t),
                    {draco::PointIndex(a), draco::PointIndex(b), draco::PointIndex(c)});
  }
  return result;
}

}  // namespace

float Grid::decoded(float coordinate, std::size_t axis) const {
  const std::int32_t steps = (1 << bits) - 1;
  draco::Quantizer quantizer;
  quantizer.Init(side, steps);
  draco::Dequantizer dequantizer;
  dequantizer.Init(side, steps);
  return dequantizer.DequantizeFloat(quantizer.QuantizeFloat(coordinate - low[axis])) + low[axis];
}

Grid grid_of(const mesh::Mesh& mesh, int bits) {
  const Bounds bounds = bounds_of(mesh.positions.span());
  Grid grid = {bounds.low, 0, bits};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    // Rounded up, or the highest vertex could lie outside by a rounding error.
    const float length = std::nextafter(bounds.high[axis] - bounds.low[axis],
                                        std::numeric_limits<float>::infinity());
    grid.side = std::max(grid.side, length);
  }
  return grid;
}

DracoStream encode_draco(const mesh::Mesh& mesh, std::size_t begin, std::size_t end,
                         const Grid& grid, int speed) {
  const bool whole = begin == 0 && end == mesh.triangles.size();
  const Part part = whole ? Part() : part_of(mesh, begin, end);
  const std::span positions = whole ? mesh.positions.span() : std::span(part.positions);
  const std::span triangles = whole ? mesh.triangles.span() : std::span(part.triangles);

  DracoStream stream;
  stream.vertices = static_cast<std::uint32_t>(positions.size());
  stream.triangles = static_cast<std::uint32_t>(triangles.size());
  const std::unique_ptr<draco::Mesh> draco_mesh = to_draco(positions, triangles);
  stream.position_id = draco_mesh->attribute(0)->unique_id();
  draco::Encoder encoder;
  encoder.SetSpeedOptions(speed, speed);
  if (triangles.empty()) {
    // Neither edgebreaker nor quantisation has a code for nothing.
    encoder.SetEncodingMethod(draco::MESH_SEQUENTIAL_ENCODING);
  } else {
    encoder.SetEncodingMethod(speed == kSequentialSpeed ? draco::MESH_SEQUENTIAL_ENCODING
                                                        : draco::MESH_EDGEBREAKER_ENCODING);
    encoder.SetAttributeExplicitQuantization(draco::GeometryAttribute::POSITION, grid.bits, 3,
                                             grid.low.data(), grid.side);
    const Bounds bounds = bounds_of(positions);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      stream.low[axis] = grid.decoded(bounds.low[axis], axis);
      stream.high[axis] = grid.decoded(bounds.high[axis], axis);
    }
  }
  draco::EncoderBuffer buffer;
  const draco::Status status = encoder.EncodeMeshToBuffer(*draco_mesh, &buffer);
  if (!status.ok()) throw Error(ErrorCode::kInternal, "Draco: " + status.error_msg_string());
  const auto bytes = std::as_bytes(std::span(buffer.data(), buffer.size()));
  stream.bytes.assign(bytes.begin(), bytes.end());
  return stream;
}

}  // namespace isomesh::codec
