// Splits vertices with several fans of triangles. Private to this folder.
#pragma once

#include <bit>
#include <vector>

#include "server/codec/draco/corners.h"
#include "server/mesh/buffer.h"

namespace isomesh::codec::edgebreaker {

// A cut through a surface can leave several open fans at one vertex, which Draco does not support.
// Each fan gets its own copy of the vertex, at the same position. Not thread safe.
class Fans {
 public:
  // `boundary` holds the corners without an opposite. On return the connectivity's vertices include
  // the copies. Its triangles are the surface's, or a modified copy owned by this object if a
  // vertex was duplicated. Closed fans are not checked.
  void separate(const std::vector<std::vector<Corner>>& boundary, Connectivity& surface);

  // The original of each copy; copies are numbered after the surface's vertices.
  const std::vector<Vertex>& originals() const { return originals_; }

  bool on_boundary(Vertex vertex) const {
    return (on_boundary_[vertex / 64] >> (vertex % 64) & 1) != 0;
  }

  template <class Visit>
  void for_each_on_boundary(Visit visit) const {
    for (std::size_t word = 0; word < on_boundary_.size(); ++word) {
      for (std::uint64_t bits = on_boundary_[word]; bits != 0; bits &= bits - 1) {
        visit(static_cast<Vertex>(64 * word + static_cast<std::size_t>(std::countr_zero(bits))));
      }
    }
  }

 private:
  void copy_vertex(Corner first, Connectivity& surface);

  std::vector<Vertex> originals_;
  std::vector<std::uint64_t> on_boundary_;
  mesh::Buffer<mesh::Triangle> triangles_;
};

}  // namespace isomesh::codec::edgebreaker
