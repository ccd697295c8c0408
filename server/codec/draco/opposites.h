// Which corners lie opposite of each other; private to this folder.
#pragma once

#include <deque>
#include <vector>

#include "server/codec/draco/corners.h"
#include "server/codec/draco/edge_rows.h"
#include "server/codec/draco/encoder.h"
#include "server/codec/draco/scratch.h"
#include "server/mesh/context.h"

namespace isomesh::codec::edgebreaker {

// Finds the opposite corners of a surface whose triangles are ordered in layers, without a table of
// all its edges: an edge of a lower vertex in layer k is complete after the triangles of layer k,
// so two layers of vertices are all that is looked at at a time. Not thread safe.
class Opposites {
 public:
  // Fills words() and boundary(). `slabs` runs of layers are worked on side by side; what is found
  // does not depend on it, but for the order of boundary(). Returns false where the surface is not
  // what corners.h describes: a triangle that repeats a vertex or names one that is not of its
  // layers, an edge that more than two triangles share, or two in the same sense. Throws Error
  // kCancelled, looked at before each layer.
  bool find(const Surface& surface, std::size_t slabs, const mesh::Context& context);

  // As Connectivity has them, for 4 * triangles + 4 words.
  const std::uint32_t* words() const { return words_.data(); }

  // The corners that have no opposite, run by run.
  const std::vector<std::vector<Corner>>& boundary() const { return boundary_; }

 private:
  struct Layers {
    std::size_t begin = 0;
    std::size_t end = 0;
  };

  bool find_in(const Surface& surface, Layers layers, std::uint32_t spare_word, EdgeRows& rows,
               std::vector<Corner>& boundary, const mesh::Context& context);
  void repeat_first_words(std::uint64_t begin, std::uint64_t end);

  Scratch<std::uint32_t> words_;
  std::vector<std::vector<Corner>> boundary_;
  std::deque<EdgeRows> rows_;  // one a slab
};

}  // namespace isomesh::codec::edgebreaker
