// Normals as an attribute of a stream's vertices. Private to this folder.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "server/codec/draco/corners.h"
#include "server/codec/draco/raw_symbols.h"
#include "server/codec/draco/value_order.h"
#include "server/mesh/buffer.h"
#include "server/mesh/mesh.h"

namespace isomesh::codec::edgebreaker {

// Unit vectors on an octahedron unfolded to a square (Cigolle and others, "A Survey of Efficient
// Representations for Independent Unit Vectors", 2014), quantised. Each is predicted by its
// predecessor in the stream, and rotated by the predecessor's position to where differences are
// small, as in libdraco's transform. A quantised normal depends only on itself. Keeps its memory.
// Not thread safe.
class NormalCoder {
 public:
  // Quantises the normals [begin, end). Several threads may quantise disjoint ranges after
  // reserve().
  void reserve(std::size_t vertices) { coordinates_.resize_for_overwrite(vertices); }
  void quantise(std::span<const mesh::Vec3> normals, std::size_t begin, std::size_t end);

  void copy(std::size_t from, std::size_t to) { coordinates_[to] = coordinates_[from]; }

  CodedValues code(const Connectivity& surface, const ValueOrder& order);

 private:
  using Coordinates = std::array<std::uint16_t, 2>;

  mesh::Buffer<Coordinates> coordinates_;
  mesh::Buffer<Coordinates> symbols_;  // in stream order
  mesh::Buffer<std::byte> coded_;
};

}  // namespace isomesh::codec::edgebreaker
