// Normals as attributes of a stream's vertices; private to this folder.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/codec/draco/corners.h"
#include "server/codec/draco/scratch.h"
#include "server/codec/draco/value_order.h"
#include "server/mesh/mesh.h"

namespace isomesh::codec::edgebreaker {

// What normals are coded to; the data lives in the coder.
struct CodedNormals {
  std::vector<std::byte> head;
  std::span<const std::byte> data;
};

// Unit vectors on an octahedron that is unfolded to a square (Cigolle and others, "A Survey of
// Efficient Representations for Independent Unit Vectors", 2014), quantised, each predicted by the
// one before it in the stream and turned by that one's place to where differences are small, as
// libdraco's own transform does it. A normal depends on nothing but itself. Keeps its memory. Not
// thread safe.
class NormalCoder {
 public:
  // Quantises the normals [begin, end), some by each of several threads, once there is room for
  // `vertices` of them.
  void reserve(std::size_t vertices) { coordinates_.reserve(vertices); }
  void quantise(std::span<const mesh::Vec3> normals, std::size_t begin, std::size_t end);

  // The vertex of that number has the normal of another one.
  void copy(std::size_t from, std::size_t to) { coordinates_[to] = coordinates_[from]; }

  CodedNormals code(const Connectivity& surface, const ValueOrder& order);

 private:
  using Coordinates = std::array<std::uint16_t, 2>;

  Scratch<Coordinates> coordinates_;  // of each vertex
  Scratch<Coordinates> symbols_;      // in the order
  Scratch<std::byte> coded_;
};

}  // namespace isomesh::codec::edgebreaker
