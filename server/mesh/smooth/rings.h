// The neighbours of every vertex in the order of its triangles; private to this folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "server/mesh/buffer.h"
#include "server/mesh/context.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// Immutable after construction, so safe to read from several threads.
class Rings {
 public:
  // Vertices with more neighbours have no ring.
  static constexpr std::size_t kMostNeighbors = 32;

  // `mesh` need not outlive this. Throws Error kCancelled.
  Rings(const Mesh& mesh, const Context& context);

  // Counter-clockwise from outside. Empty if the triangles around the vertex are not one closed fan
  // of 3 to kMostNeighbors triangles: the vertex lies on the boundary, or several walls meet there.
  std::span<const std::uint32_t> around(std::size_t vertex) const {
    return {neighbors_.data() + begin_[vertex], count_[vertex]};
  }
  bool has_ring(std::size_t vertex) const { return count_[vertex] != 0; }

  static std::uint64_t bytes(std::uint64_t vertices, std::uint64_t triangles) {
    return vertices * (sizeof(std::uint64_t) + 1) + 3 * triangles * sizeof(std::uint32_t);
  }

 private:
  Buffer<std::uint64_t> begin_;  // one more than vertices
  Buffer<std::uint8_t> count_;
  Buffer<std::uint32_t> neighbors_;
};

}  // namespace isomesh::mesh
