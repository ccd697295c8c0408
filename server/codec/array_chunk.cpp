#include "server/codec/array_chunk.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <utility>

#include <meshoptimizer.h>

namespace isomesh::codec {
namespace {

constexpr std::uint32_t kUnnamed = ~std::uint32_t{0};

// The block's triangles and vertices in writing order.
struct Order {
  Order(const mesh::Mesh& mesh, const Block& block) {
    std::vector<std::uint32_t> corners;
    std::uint32_t lowest = std::numeric_limits<std::uint32_t>::max();
    std::uint32_t highest = 0;
    for (const Run& run : block) {
      for (std::size_t t = run.begin; t < run.end; ++t) {
        for (const std::uint32_t vertex : mesh.triangles[t]) {
          corners.push_back(vertex);
          lowest = std::min(lowest, vertex);
          highest = std::max(highest, vertex);
        }
      }
    }
    // Triangles of neighbouring layers use vertices of neighbouring layers, so the range is short.
    const std::size_t range = std::size_t{highest} - lowest + 1;
    for (std::uint32_t& corner : corners) corner -= lowest;
    std::vector<std::uint32_t> ordered(corners.size());
    meshopt_optimizeVertexCacheStrip(ordered.data(), corners.data(), corners.size(), range);
    std::vector<std::uint32_t> numbers(range);
    const std::size_t count =
        meshopt_optimizeVertexFetchRemap(numbers.data(), ordered.data(), ordered.size(), range);
    indices.resize(ordered.size());
    std::ranges::transform(ordered, indices.begin(),
                           [&](std::uint32_t vertex) { return numbers[vertex]; });
    vertices.resize(count);
    for (std::size_t v = 0; v < range; ++v) {
      if (numbers[v] != kUnnamed) vertices[numbers[v]] = lowest + static_cast<std::uint32_t>(v);
    }
  }

  std::vector<std::uint32_t> indices;
  std::vector<std::uint32_t> vertices;  // indices in the mesh
};

// Appends arrays to a chunk, raw or compressed.
class Packer {
 public:
  explicit Packer(GlbCodec codec) : is_raw_(codec == GlbCodec::kQuantized) {}

  bool is_raw() const { return is_raw_; }

  // Elements are padded to multiples of four bytes.
  template <class Element>
  void add_attribute(GlbArray::Kind kind, std::span<const Element> elements) {
    static_assert(sizeof(Element) % kGlbAlignment == 0);
    if (is_raw_) return add_raw(kind, elements);
    add(kind, elements, meshopt_encodeVertexBufferBound(elements.size(), sizeof(Element)),
        [&](unsigned char* out, std::size_t most) {
          return meshopt_encodeVertexBuffer(out, most, elements.data(), elements.size(),
                                            sizeof(Element));
        });
  }

  void add_indices(std::span<const std::uint32_t> indices, std::size_t vertices) {
    constexpr auto kKind = GlbArray::Kind::kIndices;
    if (!is_raw_) {
      add(kKind, indices, meshopt_encodeIndexBufferBound(indices.size(), vertices),
          [&](unsigned char* out, std::size_t most) {
            return meshopt_encodeIndexBuffer(out, most, indices.data(), indices.size());
          });
    } else if (vertices > std::numeric_limits<std::uint16_t>::max()) {
      add_raw(kKind, indices);
    } else {
      std::vector<std::uint16_t> narrow(indices.size());
      std::ranges::transform(indices, narrow.begin(),
                             [](std::uint32_t v) { return static_cast<std::uint16_t>(v); });
      add_raw(kKind, std::span<const std::uint16_t>(narrow));
    }
  }

  ArrayChunk chunk;

 private:
  // `encode` returns the number of bytes that it wrote.
  template <class Element, class Encode>
  void add(GlbArray::Kind kind, std::span<const Element> elements, std::size_t most,
           const Encode& encode) {
    GlbArray array = {.kind = kind,
                      .begin = chunk.bytes.size(),
                      .stride = sizeof(Element),
                      .count = elements.size()};
    chunk.bytes.resize(array.begin + most);
    array.bytes = encode(reinterpret_cast<unsigned char*>(chunk.bytes.data() + array.begin), most);
    chunk.bytes.resize(glb_padded(array.begin + array.bytes));
    chunk.arrays.push_back(array);
  }

  template <class Element>
  void add_raw(GlbArray::Kind kind, std::span<const Element> elements) {
    add(kind, elements, elements.size_bytes(), [&](unsigned char* out, std::size_t most) {
      std::memcpy(out, elements.data(), most);
      return most;
    });
  }

  const bool is_raw_;
};

// A vector's three coordinates and padding.
template <class T>
using Four = std::array<T, 4>;

Four<std::uint16_t> on_steps(const mesh::Vec3& position, const Grid& grid) {
  const double steps = std::exp2(grid.bits) - 1;
  const double scale = grid.side > 0 ? steps / double{grid.side} : 0;
  Four<std::uint16_t> result = {};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double step = std::round((double{position[axis]} - grid.low[axis]) * scale);
    result[axis] = static_cast<std::uint16_t>(std::clamp(step, 0.0, steps));
  }
  return result;
}

template <class Position>
void add_positions(std::span<const Position> positions, Packer& packer) {
  packer.chunk.bounds = bounds_of(positions);
  packer.add_attribute(GlbArray::Kind::kPositions, positions);
}

constexpr int kNormalBits = 8;

std::vector<Four<std::int8_t>> octahedral(std::span<const Four<float>> normals) {
  std::vector<Four<std::int8_t>> result(normals.size());
  meshopt_encodeFilterOct(result.data(), result.size(), sizeof result[0], kNormalBits,
                          normals.data()->data());
  return result;
}

std::vector<Four<std::int8_t>> rounded(std::span<const Four<float>> normals) {
  std::vector<Four<std::int8_t>> result(normals.size());
  for (std::size_t n = 0; n < normals.size(); ++n) {
    std::ranges::transform(normals[n], result[n].begin(), [](float coordinate) {
      return static_cast<std::int8_t>(meshopt_quantizeSnorm(coordinate, kNormalBits));
    });
  }
  return result;
}

}  // namespace

ArrayChunk encode_arrays(const mesh::Mesh& mesh, const Block& block, const Grid& grid,
                         const VertexData& data, GlbCodec codec) {
  const Order order(mesh, block);
  Packer packer(codec);
  packer.chunk.vertices = static_cast<std::uint32_t>(order.vertices.size());
  packer.chunk.triangles = static_cast<std::uint32_t>(order.indices.size() / 3);
  if (is_on_steps(grid)) {
    std::vector<Four<std::uint16_t>> positions;
    for (const std::uint32_t v : order.vertices) {
      positions.push_back(on_steps(mesh.positions[v], grid));
    }
    add_positions<Four<std::uint16_t>>(positions, packer);
  } else {
    std::vector<mesh::Vec3> positions;
    for (const std::uint32_t v : order.vertices) positions.push_back(mesh.positions[v]);
    add_positions<mesh::Vec3>(positions, packer);
  }
  if (!data.normals.empty()) {
    std::vector<Four<float>> wide;
    for (const std::uint32_t v : order.vertices) {
      const auto& [x, y, z] = data.normals[v];
      wide.push_back({x, y, z, 0});
    }
    const auto normals = packer.is_raw() ? rounded(wide) : octahedral(wide);
    packer.add_attribute<Four<std::int8_t>>(GlbArray::Kind::kNormals, normals);
  }
  if (!data.distances.empty()) {
    std::vector<float> distances;
    for (const std::uint32_t v : order.vertices) distances.push_back(data.distances[v]);
    packer.add_attribute<float>(GlbArray::Kind::kDistances, distances);
  }
  packer.add_indices(order.indices, order.vertices.size());
  return std::move(packer.chunk);
}

}  // namespace isomesh::codec
