// Vertices whose triangles are not one fan; private to this folder.
#pragma once

#include <bit>
#include <vector>

#include "server/codec/draco/corners.h"
#include "server/codec/draco/scratch.h"

namespace isomesh::codec::edgebreaker {

// A cut through a surface can leave several open fans at one vertex. Draco has no such vertices:
// each fan gets one of its own, at the same place. Not thread safe.
class Fans {
 public:
  // `boundary` are the corners without an opposite. On return the connectivity's vertices are
  // numbered with the copies, and its triangles are the surface's or, where there are copies, a
  // version of them that lives here. Closed fans are not looked for.
  void separate(const std::vector<std::vector<Corner>>& boundary, Connectivity& surface);

  // Of the vertices from the surface's last on, which one each is a copy of.
  const std::vector<Vertex>& originals() const { return originals_; }

  // Whether a boundary runs through the vertex. The bits are those of all vertices.
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
  Scratch<mesh::Triangle> triangles_;
};

}  // namespace isomesh::codec::edgebreaker
