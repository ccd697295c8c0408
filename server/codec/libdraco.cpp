#include "server/codec/libdraco.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <draco/compression/encode.h>
#include <draco/mesh/mesh.h>

#include "proto/error.h"

namespace isomesh::codec {
namespace {

constexpr int kSequentialSpeed = 10;
constexpr int kDistanceBits = 12;

// Draco's entropy coder counts values in an array over all possible values, four bytes each: 4 GiB
// at 30 bits. Finer grids are stored without it, in up to four bytes per coordinate.
constexpr int kMostEntropyCodedBits = 24;

// libdraco's decoder rejects sequential streams with less than three bytes per triangle after the
// initial counts, which compressed streams may have. It ignores trailing zeros.
constexpr std::size_t kLeastPerTriangle = 3;
constexpr std::size_t kHeadBytes = 32;

// Adds an attribute with one vector or number per point. Returns its id in the stream.
template <class T>
std::uint32_t add_attribute(draco::Mesh& mesh, draco::GeometryAttribute::Type type,
                            std::span<const T> values) {
  draco::GeometryAttribute description;
  description.Init(type, nullptr, sizeof(T) / sizeof(float), draco::DT_FLOAT32, false, sizeof(T),
                   0);
  draco::PointAttribute* attribute = mesh.attribute(
      mesh.AddAttribute(description, true, static_cast<std::uint32_t>(values.size())));
  // One write for all: the attribute's buffer has our arrays' layout.
  if (!values.empty()) attribute->buffer()->Write(0, values.data(), values.size_bytes());
  return attribute->unique_id();
}

// Names an attribute in the stream's metadata, where readers look for names of generic attributes.
void name_attribute(draco::Mesh& mesh, std::uint32_t unique_id, const char* name) {
  auto metadata = std::make_unique<draco::AttributeMetadata>();
  metadata->AddEntryString("name", name);
  mesh.AddAttributeMetadata(mesh.GetAttributeIdByUniqueId(unique_id), std::move(metadata));
}

// Built from arrays: Draco's soup builder would search for duplicates again.
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

// Numbers as libdraco's options, which are text: nine digits keep every bit. Its own setters write
// six decimals, which are none of a small number.
std::string text_of(std::span<const float> numbers) {
  std::string text;
  for (const float number : numbers) {
    std::array<char, 32> digits = {};
    std::snprintf(digits.data(), digits.size(), "%.9g ", double{number});
    text += digits.data();
  }
  return text;
}

// Replaces all options of the attribute.
void quantise(draco::Encoder& encoder, draco::GeometryAttribute::Type type,
              std::span<const float> low, float range, int bits) {
  draco::Options options;
  options.SetInt("quantization_bits", bits);
  options.SetString("quantization_origin", text_of(low));
  options.SetString("quantization_range", text_of({&range, 1}));
  encoder.options().SetAttributeOptions(type, options);
}

// Edgebreaker drops triangles that repeat a vertex.
bool is_sequential(std::span<const mesh::Triangle> triangles, int speed) {
  return speed == kSequentialSpeed || std::ranges::any_of(triangles, [](const auto& triangle) {
           const auto& [a, b, c] = triangle;
           return a == b || b == c || c == a;
         });
}

}  // namespace

DracoStream encode_with_libdraco(const Arrays& arrays, const Grid& grid, int speed) {
  if (arrays.positions.size() > 3 * arrays.triangles.size()) {
    // Draco's decoder rejects sequential streams with more vertices than corners.
    OwnVertices own;
    own.begin(0, static_cast<std::uint32_t>(arrays.positions.size() - 1));
    for (const mesh::Triangle& triangle : arrays.triangles) {
      own.add(triangle, arrays.positions, arrays.data);
    }
    return encode_with_libdraco({own.positions, own.data(arrays.data.most_distance), own.triangles},
                                grid, speed);
  }
  DracoStream stream;
  const std::unique_ptr<draco::Mesh> draco_mesh =
      to_draco(arrays.positions.size(), arrays.triangles);
  stream.position_id =
      add_attribute(*draco_mesh, draco::GeometryAttribute::POSITION, arrays.positions);
  const bool sequential = is_sequential(arrays.triangles, speed);
  draco::Encoder encoder;
  const VertexData& data = arrays.data;
  if (!data.normals.empty()) {
    stream.normal_id = add_attribute(*draco_mesh, draco::GeometryAttribute::NORMAL, data.normals);
    encoder.SetAttributeQuantization(draco::GeometryAttribute::NORMAL, edgebreaker::kNormalBits);
  }
  if (!data.distances.empty()) {
    stream.distance_id =
        add_attribute(*draco_mesh, draco::GeometryAttribute::GENERIC, data.distances);
    name_attribute(*draco_mesh, stream.distance_id, kDistanceAttribute);
    // All streams share one scale, so a seam vertex has the same number on both sides.
    const float nearest = 0;
    quantise(encoder, draco::GeometryAttribute::GENERIC, {&nearest, 1},
             range_from_zero(data.most_distance, kDistanceBits), kDistanceBits);
  }
  encoder.SetSpeedOptions(speed, speed);
  // Neither edgebreaker nor quantisation supports an empty mesh.
  const bool is_empty = arrays.triangles.empty();
  encoder.SetEncodingMethod(is_empty || sequential ? draco::MESH_SEQUENTIAL_ENCODING
                                                   : draco::MESH_EDGEBREAKER_ENCODING);
  if (!is_empty) {
    quantise(encoder, draco::GeometryAttribute::POSITION, grid.low, grid.side, grid.bits);
  }
  if (grid.bits > kMostEntropyCodedBits) {
    encoder.options().SetGlobalBool("use_built_in_attribute_compression", false);
    // The predictions of the slowest speeds also count values in such an array.
    encoder.SetAttributePredictionScheme(draco::GeometryAttribute::POSITION,
                                         draco::PREDICTION_DIFFERENCE);
  }
  // In sequential encoding: indices as entropy-coded differences, a third of their size.
  encoder.options().SetGlobalBool("compress_connectivity", true);
  // If a block's cut leaves two fans at a vertex, edgebreaker duplicates it.
  encoder.SetTrackEncodedProperties(true);
  draco::EncoderBuffer buffer;
  const draco::Status status = encoder.EncodeMeshToBuffer(*draco_mesh, &buffer);
  if (!status.ok()) throw Error(ErrorCode::kInternal, "Draco: " + status.error_msg_string());
  stream.vertices = static_cast<std::uint32_t>(encoder.num_encoded_points());
  stream.triangles = static_cast<std::uint32_t>(encoder.num_encoded_faces());
  if (stream.triangles != arrays.triangles.size()) {
    throw Error(ErrorCode::kInternal, "Draco dropped triangles");
  }
  const auto bytes = std::as_bytes(std::span(buffer.data(), buffer.size()));
  stream.bytes.assign(bytes.begin(), bytes.end());
  if (sequential) {
    stream.bytes.resize(std::max(bytes.size(), kHeadBytes + kLeastPerTriangle * stream.triangles));
  }
  return stream;
}

}  // namespace isomesh::codec
