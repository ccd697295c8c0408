#include "server/codec/draco_chunk.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <span>
#include <string>

#include <draco/compression/encode.h>
#include <draco/core/quantization_utils.h>
#include <draco/mesh/mesh.h>

#include "proto/error.h"

namespace isomesh::codec {
namespace {

constexpr int kSequentialSpeed = 10;
constexpr int kNormalBits = 10;  // of each octahedral coordinate: a tenth of a degree

// Draco's entropy coder counts values in an array of all that there could be, four bytes each: 4
// GiB at 30 bits. Finer grids than this are stored without it, in up to four bytes a coordinate.
constexpr int kMostEntropyCodedBits = 24;

// Draco keeps its options as text with six decimals: what it quantises with is what that reads as.
constexpr float kOptionStep = 1e-6F;

float as_draco_keeps(float value) { return std::stof(std::to_string(value)); }

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
  std::vector<mesh::Vec3> normals;  // as many, or none
  std::vector<mesh::Triangle> triangles;
};

// Calls visit(triangle) for the block's triangles in order.
template <class Visit>
void for_each_triangle(const mesh::Mesh& mesh, const Block& block, Visit visit) {
  for (const Run& run : block) {
    for (std::size_t t = run.begin; t < run.end; ++t) visit(mesh.triangles[t]);
  }
}

Part part_of(const mesh::Mesh& mesh, const Block& block, std::span<const mesh::Vec3> normals) {
  constexpr std::uint32_t kUnnamed = std::numeric_limits<std::uint32_t>::max();
  std::uint32_t low = kUnnamed;
  std::uint32_t high = 0;
  std::size_t triangles = 0;
  for_each_triangle(mesh, block, [&](const mesh::Triangle& triangle) {
    for (const std::uint32_t vertex : triangle) {
      low = std::min(low, vertex);
      high = std::max(high, vertex);
    }
    ++triangles;
  });
  // Triangles of neighbouring layers name vertices of neighbouring layers, so the range is short.
  std::vector<std::uint32_t> number(std::size_t{high} - low + 1, kUnnamed);
  Part part;
  part.positions.reserve(triangles / 2);
  part.triangles.reserve(triangles);
  for_each_triangle(mesh, block, [&](const mesh::Triangle& triangle) {
    mesh::Triangle& renumbered = part.triangles.emplace_back();
    for (std::size_t corner = 0; corner < 3; ++corner) {
      std::uint32_t& vertex = number[triangle[corner] - low];
      if (vertex == kUnnamed) {
        vertex = static_cast<std::uint32_t>(part.positions.size());
        part.positions.push_back(mesh.positions[triangle[corner]]);
        if (!normals.empty()) part.normals.push_back(normals[triangle[corner]]);
      }
      renumbered[corner] = vertex;
    }
  });
  return part;
}

// Adds one vector a point. Returns the attribute's id within the stream.
std::uint32_t add_attribute(draco::Mesh& mesh, draco::GeometryAttribute::Type type,
                            std::span<const mesh::Vec3> vectors) {
  draco::GeometryAttribute description;
  description.Init(type, nullptr, 3, draco::DT_FLOAT32, false, sizeof(mesh::Vec3), 0);
  draco::PointAttribute* attribute = mesh.attribute(
      mesh.AddAttribute(description, true, static_cast<std::uint32_t>(vectors.size())));
  // One write for all: the attribute's buffer has the layout of our vectors.
  if (!vectors.empty()) attribute->buffer()->Write(0, vectors.data(), vectors.size_bytes());
  return attribute->unique_id();
}

// Built from arrays: Draco's soup builder would look for duplicates again.
std::unique_ptr<draco::Mesh> to_draco(std::size_t vertices,
                                      std::span<const mesh::Triangle> triangles) {
  auto result = std::make_unique<draco::Mesh>();
  result->set_num_points(static_cast<std::uint32_t>(vertices));
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
  Grid grid = {.low = {}, .side = 0, .bits = bits};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    grid.low[axis] = as_draco_keeps(bounds.low[axis]);
    // A little more, or the highest vertex could lie outside by a rounding error.
    const float length = bounds.high[axis] - grid.low[axis] + kOptionStep;
    grid.side = std::max(grid.side, as_draco_keeps(length));
  }
  return grid;
}

std::vector<Block> cut_blocks(const mesh::Mesh& mesh, std::size_t triangles_per_block) {
  const auto triangles = static_cast<double>(mesh.triangles.size());
  const auto layers = static_cast<double>(mesh.layers());
  const auto target = static_cast<double>(triangles_per_block);
  if (mesh.triangles.size() == 0) return {};
  // As if the volume were as deep as it is high: then a block of n layers by a layer's nth part is
  // a cube.
  const auto parts =
      static_cast<std::size_t>(std::max(1.0, std::round(std::sqrt(triangles / target))));
  const auto depth = static_cast<std::size_t>(
      std::max(1.0, std::round(target * static_cast<double>(parts) * layers / triangles)));
  std::vector<Block> blocks;
  for (std::size_t bottom = 0; bottom < mesh.layers(); bottom += depth) {
    const std::size_t top = std::min(mesh.layers(), bottom + depth);
    for (std::size_t part = 0; part < parts; ++part) {
      Block block;
      for (std::size_t layer = bottom; layer < top; ++layer) {
        const std::uint64_t first = mesh.layer_triangles[layer];
        const std::uint64_t count = mesh.layer_triangles[layer + 1] - first;
        const Run run = {first + count * part / parts, first + count * (part + 1) / parts};
        if (run.begin < run.end) block.push_back(run);
      }
      if (!block.empty()) blocks.push_back(std::move(block));
    }
  }
  return blocks;
}

Block whole_block(const mesh::Mesh& mesh) { return {{0, mesh.triangles.size()}}; }

DracoStream encode_draco(const mesh::Mesh& mesh, const Block& block, const Grid& grid, int speed,
                         std::span<const mesh::Vec3> normals) {
  const bool whole =
      block.size() == 1 && block[0].begin == 0 && block[0].end == mesh.triangles.size();
  const Part part = whole ? Part() : part_of(mesh, block, normals);
  const std::span positions = whole ? mesh.positions.span() : std::span(part.positions);
  const std::span triangles = whole ? mesh.triangles.span() : std::span(part.triangles);

  DracoStream stream;
  const std::unique_ptr<draco::Mesh> draco_mesh = to_draco(positions.size(), triangles);
  stream.position_id = add_attribute(*draco_mesh, draco::GeometryAttribute::POSITION, positions);
  draco::Encoder encoder;
  if (!normals.empty()) {
    stream.normal_id = add_attribute(*draco_mesh, draco::GeometryAttribute::NORMAL,
                                     whole ? normals : std::span(part.normals));
    encoder.SetAttributeQuantization(draco::GeometryAttribute::NORMAL, kNormalBits);
  }
  encoder.SetSpeedOptions(speed, speed);
  if (grid.bits > kMostEntropyCodedBits) {
    encoder.options().SetGlobalBool("use_built_in_attribute_compression", false);
    // The predictions of the slowest speeds count values too.
    encoder.SetAttributePredictionScheme(draco::GeometryAttribute::POSITION,
                                         draco::PREDICTION_DIFFERENCE);
  }
  // Of the sequential encoding: indices as entropy coded differences, a third of their size.
  encoder.options().SetGlobalBool("compress_connectivity", true);
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
  // Where a block's cut leaves two fans at one vertex, edgebreaker makes two of it.
  encoder.SetTrackEncodedProperties(true);
  draco::EncoderBuffer buffer;
  const draco::Status status = encoder.EncodeMeshToBuffer(*draco_mesh, &buffer);
  if (!status.ok()) throw Error(ErrorCode::kInternal, "Draco: " + status.error_msg_string());
  stream.vertices = static_cast<std::uint32_t>(encoder.num_encoded_points());
  stream.triangles = static_cast<std::uint32_t>(encoder.num_encoded_faces());
  if (stream.triangles != triangles.size()) {
    throw Error(ErrorCode::kInternal, "Draco dropped triangles");
  }
  const auto bytes = std::as_bytes(std::span(buffer.data(), buffer.size()));
  stream.bytes.assign(bytes.begin(), bytes.end());
  return stream;
}

}  // namespace isomesh::codec
