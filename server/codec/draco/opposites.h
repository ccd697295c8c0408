// Computes opposite corners. Private to this folder.
#pragma once

#include <deque>
#include <vector>

#include "server/codec/draco/corners.h"
#include "server/codec/draco/edge_rows.h"
#include "server/codec/draco/encoder.h"
#include "server/mesh/buffer.h"
#include "server/mesh/context.h"

namespace isomesh::codec::edgebreaker {

// Finds the opposite corners of a surface whose triangles are ordered in layers, without a table of
// all its edges: an edge whose lower vertex is in layer k is complete after the triangles of layer
// k, so two layers of vertices suffice at a time. Not thread safe.
class Opposites {
 public:
  // Fills words() and boundary(). `slabs` runs of layers are processed in parallel; only the order
  // of boundary() depends on their number. Returns false if the surface violates corners.h: a
  // triangle repeats a vertex or has one of other layers, or an edge has more than two triangles or
  // two in the same direction. Throws Error kCancelled, checked before each layer.
  bool find(const Surface& surface, std::size_t slabs, const mesh::Context& context);

  // Connectivity::words, 4 * triangles + 4 of them.
  const std::uint32_t* words() const { return words_.data(); }

  // The corners without an opposite, per run.
  const std::vector<std::vector<Corner>>& boundary() const { return boundary_; }

 private:
  struct Layers {
    std::size_t begin = 0;
    std::size_t end = 0;
  };

  bool find_in(const Surface& surface, Layers layers, std::uint32_t spare_word, EdgeRows& rows,
               std::vector<Corner>& boundary, const mesh::Context& context);
  void repeat_first_words(std::uint64_t begin, std::uint64_t end);

  mesh::Buffer<std::uint32_t> words_;
  std::vector<std::vector<Corner>> boundary_;
  std::deque<EdgeRows> rows_;  // one per slab
};

}  // namespace isomesh::codec::edgebreaker
