// The edges of two layers of vertices while their second triangles are looked for; private to this
// folder.
#pragma once

#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "server/codec/draco/corners.h"
#include "server/codec/draco/scratch.h"

namespace isomesh::codec::edgebreaker {

// In an oriented manifold an edge has one half-edge that goes up in the numbers of vertices and one
// that goes down. Those that go up are put into the row of their lower vertex; those that go down
// look there, a block of triangles later, while all of it is still in the nearest cache. What does
// not find its partner asks again when the layer is done. Nothing in these loops branches on what
// cannot be foreseen. Not thread safe.
class EdgeRows {
 public:
  // Which half-edges are taken: those whose lower vertex is one of `owned` from `first` on. Up to
  // `window` vertices, consecutive ones, are open at a time. `words` is the table of the opposite
  // corners, which is filled, and of which `spare_word` may be written over at any time.
  struct Range {
    Vertex first = 0;
    Vertex owned = 0;
    std::uint64_t window = 0;
    std::uint32_t spare_word = 0;
  };
  void begin(const Range& range, std::uint32_t* words);

  // Takes the half-edges of these consecutive faces.
  void add(const mesh::Triangle* triangles, Face begin, Face end);

  // No more triangles name the vertices [begin, end), all of them owned: half-edges of theirs that
  // are alone are the boundary's. The ranges follow each other.
  void finish(Vertex begin, Vertex end, Corner none, std::vector<Corner>& boundary);

  // Whether every edge had at most one half-edge in each sense, and no face repeated a vertex.
  // Once all is finished.
  bool is_manifold() const { return !clash_ && waiting_.empty() && crowded_.empty(); }

 private:
  static constexpr std::uint32_t kSlots = 8;  // few vertices have more edges that go up
  static constexpr Face kBlock = 512;

  struct alignas(64) Row {
    std::array<std::uint32_t, kSlots> upper;  // the edges' other vertices
    std::array<Corner, kSlots> corner;
  };
  // A half-edge that goes down, by the corner on its other side.
  struct Down {
    Corner corner;
    Vertex lower;
    Vertex upper;
  };

  std::uint32_t row_of(Vertex vertex) const { return (vertex - range_.first) & mask_; }
  std::size_t scatter(const mesh::Triangle* triangles, Face begin, Face end);
  std::size_t match(const Down* downs, std::size_t count, Down* rest);
  void take_crowded(Vertex lower, Vertex upper, Corner corner);
  void set_boundary(Corner corner, Corner none, std::vector<Corner>& boundary);

  Range range_;
  std::uint32_t* words_ = nullptr;
  std::uint32_t mask_ = 0;
  std::uint32_t spare_ = 0;  // the row for what is not taken
  bool clash_ = false;
  Scratch<Row> rows_;
  Scratch<std::uint8_t> used_;   // slots of each row
  Scratch<std::uint8_t> found_;  // a bit for each of them that has its partner
  Scratch<Down> downs_;          // of one block
  std::vector<Down> waiting_;    // that found nothing yet
  std::unordered_map<std::uint64_t, Corner> crowded_;  // what goes up and found its row full
};

}  // namespace isomesh::codec::edgebreaker
