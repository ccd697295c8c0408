// The collapses of a surface, which can be undone; private to this folder.
//
// A collapse draws a vertex into a neighbour, in all its triangles. So each triangle that is left
// is an original one with other corners, and one that is gone has two corners that became the same.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/mesh.h"

namespace isomesh::mesh::collapse {

struct Collapse {
  std::uint32_t vertex = 0;
  std::uint32_t into = 0;
  std::uint32_t step = 0;  // more than that of each collapse before that changed a triangle of it
};

// Takes 4 bytes a triangle, and some 20 more from the first undo on.
class History {
 public:
  explicit History(std::size_t vertices = 0);

  // Thread safe for different vertices.
  void add(const Collapse& collapse) {
    into_[collapse.vertex] = collapse.into;
    step_[collapse.vertex] = collapse.step;
  }

  // Undoes the last `count` collapses of corners of each of these triangles, and all later ones of
  // triangles that an undone one had changed. So each of the others finds its triangles as it did.
  // Returns the triangles that may have changed, ascending. `originals` are always the same.
  std::vector<std::uint32_t> undo(std::span<const Triangle> originals,
                                  std::span<const std::uint32_t> which, std::size_t count);

  // The vertex that a vertex has become; itself if it is left.
  std::uint32_t kept(std::uint32_t vertex) const;

  // The corners that a triangle has now; two are the same if it is gone.
  Triangle corners_of(Triangle original) const;

 private:
  template <class Visit>
  void walk(Triangle corners, Visit visit) const;
  void make_index(std::span<const Triangle> originals);
  void find_children();
  void undo(std::uint32_t vertex);
  template <class Visit>
  void visit_triangles(std::uint32_t vertex, Visit visit);

  std::vector<std::uint32_t> into_, step_;      // of each vertex that is gone
  std::vector<std::size_t> begins_;             // by vertex: of its original triangles
  std::vector<std::uint32_t> triangles_;        // of one vertex after the other
  std::vector<std::uint32_t> child_, sibling_;  // vertices that were drawn into a vertex
  std::vector<std::uint8_t> is_undone_;
  std::vector<std::uint32_t> undone_, stack_;
};

}  // namespace isomesh::mesh::collapse
