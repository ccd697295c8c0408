#include "server/codec/meshopt_chunk.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>

#include <meshoptimizer.h>

#include "server/codec/glb_document.h"

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

// Appends an array whose elements are padded to multiples of four bytes.
template <class Element>
void add_array(MeshoptArray::Kind kind, std::span<const Element> elements, MeshoptChunk& chunk) {
  static_assert(sizeof(Element) % 4 == 0);
  MeshoptArray array = {.kind = kind,
                        .begin = chunk.bytes.size(),
                        .stride = sizeof(Element),
                        .count = elements.size()};
  chunk.bytes.resize(array.begin + meshopt_encodeVertexBufferBound(array.count, array.stride));
  array.bytes = meshopt_encodeVertexBuffer(
      reinterpret_cast<unsigned char*>(chunk.bytes.data() + array.begin),
      chunk.bytes.size() - array.begin, elements.data(), array.count, array.stride);
  chunk.bytes.resize(glb_padded(array.begin + array.bytes));
  chunk.arrays.push_back(array);
}

void add_indices(const Order& order, MeshoptChunk& chunk) {
  MeshoptArray array = {.kind = MeshoptArray::Kind::kIndices,
                        .begin = chunk.bytes.size(),
                        .stride = sizeof(std::uint32_t),
                        .count = order.indices.size()};
  chunk.bytes.resize(array.begin +
                     meshopt_encodeIndexBufferBound(array.count, order.vertices.size()));
  array.bytes = meshopt_encodeIndexBuffer(
      reinterpret_cast<unsigned char*>(chunk.bytes.data() + array.begin),
      chunk.bytes.size() - array.begin, order.indices.data(), array.count);
  chunk.bytes.resize(glb_padded(array.begin + array.bytes));
  chunk.arrays.push_back(array);
}

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
void add_positions(std::span<const Position> positions, MeshoptChunk& chunk) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto of_axis = [axis](const Position& position) { return position[axis]; };
    const auto [low, high] = std::ranges::minmax_element(positions, {}, of_axis);
    chunk.low[axis] = static_cast<float>(of_axis(*low));
    chunk.high[axis] = static_cast<float>(of_axis(*high));
  }
  add_array(MeshoptArray::Kind::kPositions, positions, chunk);
}

}  // namespace

MeshoptChunk encode_with_meshopt(const mesh::Mesh& mesh, const Block& block, const Grid& grid,
                                 const VertexData& data) {
  const Order order(mesh, block);
  MeshoptChunk chunk;
  chunk.vertices = static_cast<std::uint32_t>(order.vertices.size());
  chunk.triangles = static_cast<std::uint32_t>(order.indices.size() / 3);
  if (is_on_steps(grid)) {
    std::vector<Four<std::uint16_t>> positions;
    for (const std::uint32_t v : order.vertices) {
      positions.push_back(on_steps(mesh.positions[v], grid));
    }
    add_positions<Four<std::uint16_t>>(positions, chunk);
  } else {
    std::vector<mesh::Vec3> positions;
    for (const std::uint32_t v : order.vertices) positions.push_back(mesh.positions[v]);
    add_positions<mesh::Vec3>(positions, chunk);
  }
  if (!data.normals.empty()) {
    constexpr int kNormalBits = 8;
    std::vector<Four<float>> wide;
    for (const std::uint32_t v : order.vertices) {
      const auto& [x, y, z] = data.normals[v];
      wide.push_back({x, y, z, 0});
    }
    std::vector<Four<std::int8_t>> normals(wide.size());
    meshopt_encodeFilterOct(normals.data(), normals.size(), sizeof normals[0], kNormalBits,
                            wide.data()->data());
    add_array<Four<std::int8_t>>(MeshoptArray::Kind::kNormals, normals, chunk);
  }
  if (!data.distances.empty()) {
    std::vector<float> distances;
    for (const std::uint32_t v : order.vertices) distances.push_back(data.distances[v]);
    add_array<float>(MeshoptArray::Kind::kDistances, distances, chunk);
  }
  add_indices(order, chunk);
  return chunk;
}

}  // namespace isomesh::codec
