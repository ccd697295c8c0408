#include <algorithm>
#include <cmath>
#include <cstring>
#include <initializer_list>
#include <set>

#include <meshoptimizer.h>
#include <nlohmann/json.hpp>

#include "proto/error.h"
#include "proto/json_text.h"
#include "server/codec/decode/decoders.h"
#include "server/mesh/parallel.h"

namespace isomesh::codec::decoding {
namespace {

// As what writes the document, so that the compiler makes it once.
using Json = nlohmann::ordered_json;

// Reads a little-endian number; the caller has checked the bounds.
std::uint32_t word_at(Bytes bytes, std::size_t offset) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

// glTF 2.0, section 4.4.
constexpr std::uint32_t kMagic = 0x46546C67;
constexpr std::uint32_t kJsonChunk = 0x4E4F534A;
constexpr std::uint32_t kBinaryChunk = 0x004E4942;
constexpr std::size_t kHeaderBytes = 12;
constexpr std::size_t kChunkHeaderBytes = 8;

[[noreturn]] void refuse_glb(const std::string& why) { refuse(MeshFormat::kGlb, why); }

struct Chunks {
  Bytes json;
  Bytes binary;
};

Chunks chunks_of(Bytes file) {
  if (file.size() < kHeaderBytes || word_at(file, 0) != kMagic || word_at(file, 4) != 2 ||
      word_at(file, 8) != file.size()) {
    refuse_glb("its header is not that of a complete file of version 2");
  }
  Bytes rest = file.subspan(kHeaderBytes);
  const auto take = [&](std::uint32_t type, const char* name) {
    if (rest.size() < kChunkHeaderBytes || word_at(rest, 4) != type) {
      refuse_glb(std::string("its chunk of ") + name + " is missing");
    }
    const std::size_t bytes = word_at(rest, 0);
    if (bytes > rest.size() - kChunkHeaderBytes) {
      refuse_glb(std::string("it ends within its chunk of ") + name);
    }
    const Bytes chunk = rest.subspan(kChunkHeaderBytes, bytes);
    rest = rest.subspan(kChunkHeaderBytes + bytes);
    return chunk;
  };
  Chunks chunks;
  chunks.json = take(kJsonChunk, "JSON");
  if (!rest.empty()) chunks.binary = take(kBinaryChunk, "binary data");
  if (!rest.empty()) refuse_glb("extra data follows its chunks");
  return chunks;
}

// Row-major, for column vectors of homogeneous coordinates.
using Matrix = std::array<std::array<double, 4>, 4>;

constexpr Matrix kIdentity = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}};
// glTF's metres, Y up, front +Z, to LPS millimetres.
constexpr Matrix kToPatient = {{{1000, 0, 0, 0}, {0, 0, -1000, 0}, {0, 1000, 0, 0}, {0, 0, 0, 1}}};

Matrix times(const Matrix& a, const Matrix& b) {
  Matrix product = {};
  for (std::size_t row = 0; row < 4; ++row) {
    for (std::size_t column = 0; column < 4; ++column) {
      for (std::size_t k = 0; k < 4; ++k) product[row][column] += a[row][k] * b[k][column];
    }
  }
  return product;
}

Matrix transformation_of(const Json& node) {
  if (node.contains("matrix")) refuse_glb("a node has a matrix");
  const auto [x, y, z, w] = node.value("rotation", std::array<double, 4>{0, 0, 0, 1});
  const auto scale = node.value("scale", std::array<double, 3>{1, 1, 1});
  const auto move = node.value("translation", std::array<double, 3>{0, 0, 0});
  Matrix matrix = {{{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), 0},
                    {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), 0},
                    {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), 0},
                    {0, 0, 0, 1}}};
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column) matrix[row][column] *= scale[column];
    matrix[row][3] = move[row];
  }
  return matrix;
}

// An array as it is stored.
struct Array {
  Bytes bytes;
  std::size_t stride = 0;  // of an element that is not compressed
  std::size_t count = 0;
  bool is_packed = false;  // by meshoptimizer
};

struct Primitive {
  Bytes stream;  // of Draco; empty if the arrays are uncompressed
  int position_id = 0;
  Array positions;
  Array indices;
  Matrix to_patient = kIdentity;
  std::size_t vertices = 0;
  std::size_t triangles = 0;
};

// The visible primitives of the default scene. Coarser levels of detail are nodes that are no
// node's child.
class Scene {
 public:
  Scene(const Json& gltf, Bytes binary) : gltf_(gltf), binary_(binary) {
    for (const Json& node : gltf.at("scenes").at(gltf.at("scene").get<std::size_t>()).at("nodes")) {
      visit(node.get<std::size_t>(), kToPatient);
    }
  }

  const std::vector<Primitive>& primitives() const { return primitives_; }

 private:
  void visit(std::size_t number, const Matrix& above) {
    if (!visited_.insert(number).second) refuse_glb("a node occurs twice");
    const Json& node = gltf_.at("nodes").at(number);
    const Matrix matrix = times(above, transformation_of(node));
    if (node.contains("mesh")) {
      for (const Json& json :
           gltf_.at("meshes").at(node["mesh"].get<std::size_t>()).at("primitives")) {
        Primitive& primitive = primitives_.emplace_back(primitive_of(json));
        primitive.to_patient = matrix;
        // Draco positions are used without a transformation.
        if (!primitive.stream.empty()) expect_identity(matrix);
      }
    }
    if (!node.contains("children")) return;
    for (const Json& child : node["children"]) visit(child.get<std::size_t>(), matrix);
  }

  static void expect_identity(const Matrix& matrix) {
    constexpr double kNearly = 1e-9;
    for (std::size_t row = 0; row < 4; ++row) {
      for (std::size_t column = 0; column < 4; ++column) {
        if (!(std::abs(matrix[row][column] - kIdentity[row][column]) < kNearly)) {
          refuse_glb("its nodes do not turn LPS millimetres into metres with Y up");
        }
      }
    }
  }

  Bytes binary_at(const Json& place) const {
    const auto offset = place.at("byteOffset").get<std::size_t>();
    const auto bytes = place.at("byteLength").get<std::size_t>();
    if (offset > binary_.size() || bytes > binary_.size() - offset) {
      refuse_glb("a buffer view ends after the file's binary data");
    }
    return binary_.subspan(offset, bytes);
  }

  const Json& accessor(const Json& number) const {
    return gltf_.at("accessors").at(number.get<std::size_t>());
  }

  Array array_of(const Json& number, std::string_view mode) const {
    const Json& described = accessor(number);
    const Json& view = gltf_.at("bufferViews").at(described.at("bufferView").get<std::size_t>());
    if (!view.contains("extensions")) {
      constexpr int kUnsignedShort = 5123;
      const bool is_narrow = described.at("componentType") == kUnsignedShort;
      const std::size_t index = is_narrow ? sizeof(std::uint16_t) : sizeof(std::uint32_t);
      return {.bytes = binary_at(view),
              .stride = view.value("byteStride", index),
              .count = described.at("count").get<std::size_t>()};
    }
    const Json& extensions = view["extensions"];
    const Json& packed = extensions.contains("KHR_meshopt_compression")
                             ? extensions["KHR_meshopt_compression"]
                             : extensions.at("EXT_meshopt_compression");
    if (packed.at("mode") != mode) refuse_glb("an array has another compression mode");
    return {.bytes = binary_at(packed),
            .stride = packed.at("byteStride").get<std::size_t>(),
            .count = packed.at("count").get<std::size_t>(),
            .is_packed = true};
  }

  Primitive primitive_of(const Json& json) const {
    const auto count_of = [&](const Json& number) {
      return accessor(number).at("count").get<std::size_t>();
    };
    const Json& position = json.at("attributes").at("POSITION");
    Primitive primitive;
    primitive.vertices = count_of(position);
    primitive.triangles = count_of(json.at("indices")) / 3;
    if (!json.contains("extensions")) {
      primitive.positions = array_of(position, "ATTRIBUTES");
      primitive.indices = array_of(json.at("indices"), "TRIANGLES");
      return primitive;
    }
    const Json& draco = json.at("extensions").at("KHR_draco_mesh_compression");
    const Json& view = gltf_.at("bufferViews").at(draco.at("bufferView").get<std::size_t>());
    primitive.stream = binary_at(view);
    if (primitive.stream.empty()) refuse_glb("a stream is empty");
    primitive.position_id = draco.at("attributes").at("POSITION").get<int>();
    return primitive;
  }

  const Json& gltf_;
  const Bytes binary_;
  std::set<std::size_t> visited_;
  std::vector<Primitive> primitives_;
};

std::vector<Primitive> primitives_of(Bytes file) {
  const Chunks chunks = chunks_of(file);
  try {
    const auto* json = reinterpret_cast<const char*>(chunks.json.data());
    const auto gltf = parse_json<Json>({json, chunks.json.size()});
    return Scene(gltf, chunks.binary).primitives();
  } catch (const Json::exception& error) {
    refuse_glb(std::string("its JSON is malformed: ") + error.what());
  }
}

template <class Position>
void place(const std::vector<Position>& stored, const Matrix& matrix, DecodedSurface& surface) {
  surface.positions.resize_for_overwrite(stored.size());
  for (std::size_t v = 0; v < stored.size(); ++v) {
    for (std::size_t row = 0; row < 3; ++row) {
      double coordinate = matrix[row][3];
      for (std::size_t column = 0; column < 3; ++column) {
        coordinate += matrix[row][column] * stored[v][column];
      }
      surface.positions[v][row] = static_cast<float>(coordinate);
    }
  }
}

template <class Position>
void unpack_positions(const Primitive& primitive, DecodedSurface& surface) {
  const Array& array = primitive.positions;
  std::vector<Position> stored(array.count);
  if (!array.is_packed) {
    if (!stored.empty()) std::memcpy(stored.data(), array.bytes.data(), array.bytes.size());
  } else if (meshopt_decodeVertexBuffer(stored.data(), array.count, array.stride,
                                        reinterpret_cast<const unsigned char*>(array.bytes.data()),
                                        array.bytes.size()) != 0) {
    refuse_glb("meshoptimizer cannot decode its positions");
  }
  place(stored, primitive.to_patient, surface);
}

void unpack_indices(const Array& array, mesh::Buffer<mesh::Triangle>& triangles) {
  if (triangles.size() == 0) return;
  if (array.stride == sizeof(std::uint16_t)) {
    const auto index = [&](std::size_t number) {
      std::uint16_t value = 0;
      std::memcpy(&value, array.bytes.data() + number * sizeof value, sizeof value);
      return std::uint32_t{value};
    };
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      triangles[t] = {index(3 * t), index(3 * t + 1), index(3 * t + 2)};
    }
  } else if (!array.is_packed) {
    std::memcpy(triangles.data(), array.bytes.data(), array.bytes.size());
  } else if (meshopt_decodeIndexBuffer(triangles.data(), array.count, array.stride,
                                       reinterpret_cast<const unsigned char*>(array.bytes.data()),
                                       array.bytes.size()) != 0) {
    refuse_glb("meshoptimizer cannot decode its triangles");
  }
}

// True if the array has so many elements of one of these sizes, and about as many bytes as they
// need.
bool holds(const Array& array, std::size_t count, std::initializer_list<std::size_t> strides) {
  constexpr std::size_t kMostPerByte = 4096;  // far above the codec's best compression
  return array.count == count && std::ranges::find(strides, array.stride) != strides.end() &&
         (array.is_packed ? count / kMostPerByte <= array.bytes.size()
                          : array.bytes.size() / array.stride == count &&
                                array.bytes.size() % array.stride == 0);
}

DecodedSurface unpack(const Primitive& primitive) {
  using Steps = std::array<std::uint16_t, 4>;
  const Array& positions = primitive.positions;
  const Array& indices = primitive.indices;
  if (!holds(positions, primitive.vertices, {sizeof(Steps), sizeof(mesh::Vec3)}) ||
      !holds(indices, 3 * primitive.triangles, {sizeof(std::uint16_t), sizeof(std::uint32_t)}) ||
      (indices.is_packed && indices.stride != sizeof(std::uint32_t))) {
    refuse_glb("a block's accessors do not match its content");
  }
  DecodedSurface surface;
  if (positions.stride == sizeof(Steps)) {
    unpack_positions<Steps>(primitive, surface);
  } else {
    unpack_positions<mesh::Vec3>(primitive, surface);
  }
  surface.triangles.resize_for_overwrite(primitive.triangles);
  unpack_indices(indices, surface.triangles);
  return surface;
}

}  // namespace

DecodedSurface decode_glb(Bytes file, const mesh::Context& context) {
  const std::vector<Primitive> primitives = primitives_of(file);
  std::vector<DecodedSurface> parts(primitives.size());
  mesh::parallel_for(context, primitives.size(), [&](std::size_t n) {
    const Primitive& primitive = primitives[n];
    if (primitive.stream.empty()) {
      parts[n] = unpack(primitive);
      return;
    }
    parts[n] = decode_draco_stream(primitive.stream, primitive.position_id);
    if (parts[n].positions.size() != primitive.vertices ||
        parts[n].triangles.size() != primitive.triangles) {
      refuse_glb("the accessors of block " + std::to_string(n) + " do not match its content");
    }
  });
  return join(std::move(parts), context);
}

}  // namespace isomesh::codec::decoding
