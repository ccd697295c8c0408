// Matches the half-edges of two layers of vertices. Private to this folder.
#pragma once

#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "server/codec/draco/corners.h"
#include "server/mesh/buffer.h"

namespace isomesh::codec::edgebreaker {

// In an oriented manifold an edge has one half-edge that ascends in the numbers of vertices and one
// that descends. Ascending ones are stored in the row of their lower vertex. Descending ones are
// looked up one block of triangles later, while the rows are still in the first-level cache. Those
// without a partner are looked up again at the end of the layer. The loops have no unpredictable
// branches. Not thread safe.
class EdgeRows {
 public:
  // The half-edges to take: their lower vertex is one of `owned` vertices from `first` on. At most
  // `window` consecutive vertices are open at a time. `words` is the table of opposite corners to
  // fill; `spare_word` in it may be overwritten at any time.
  struct Range {
    Vertex first = 0;
    Vertex owned = 0;
    std::uint64_t window = 0;
    std::uint32_t spare_word = 0;
  };
  void begin(const Range& range, std::uint32_t* words);

  void add(const mesh::Triangle* triangles, Face begin, Face end);

  // No later triangle has the vertices [begin, end), all owned: their unmatched half-edges are
  // boundary edges. Calls have consecutive ranges.
  void finish(Vertex begin, Vertex end, Corner none, std::vector<Corner>& boundary);

  // True if every edge had at most one half-edge in each direction, and no face repeated a vertex.
  // Valid once all is finished.
  bool is_manifold() const { return !clash_ && waiting_.empty() && crowded_.empty(); }

 private:
  static constexpr std::uint32_t kSlots = 8;  // few vertices have more ascending edges
  static constexpr Face kBlock = 512;

  struct alignas(64) Row {
    std::array<std::uint32_t, kSlots> upper;  // the upper vertices of the edges
    std::array<Corner, kSlots> corner;
  };
  // A descending half-edge, by the opposite corner.
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
  std::uint32_t spare_ = 0;  // the row for half-edges of others
  bool clash_ = false;
  mesh::Buffer<Row> rows_;
  mesh::Buffer<std::uint8_t> used_;                    // slots of each row
  mesh::Buffer<std::uint8_t> found_;                   // one bit per slot: its partner was found
  mesh::Buffer<Down> downs_;                           // of one block
  std::vector<Down> waiting_;                          // without a partner yet
  std::unordered_map<std::uint64_t, Corner> crowded_;  // ascending half-edges whose row was full
};

}  // namespace isomesh::codec::edgebreaker
