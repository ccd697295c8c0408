// Which samples are inside, one bit each, and the logic on 64 samples at a time that extraction
// counts and walks with.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "server/mesh/lattice.h"
#include "server/mesh/tetrahedra.h"

namespace isomesh::mesh {

using Word = std::uint64_t;  // 64 samples of a row, the lowest bit the smallest x
inline constexpr unsigned kWordBits = 64;

// The smallest value of T that is inside, so that classifying compares T with T. Empty when no
// value of T is inside.
template <class T>
std::optional<T> smallest_inside(double iso);

// The signs of one plane of samples. Each row ends in one word of zeros, so that the word after a
// row's last one can be read.
class SignPlane {
 public:
  explicit SignPlane(const Dims& dims)
      : words_((dims.x + kWordBits - 1) / kWordBits), bits_((words_ + 1) * dims.y) {}

  std::size_t words() const { return words_; }
  Word* row(std::size_t y) { return bits_.data() + y * (words_ + 1); }
  const Word* row(std::size_t y) const { return bits_.data() + y * (words_ + 1); }

 private:
  std::size_t words_;
  std::vector<Word> bits_;
};

// Fills `plane` with the signs of the samples of plane z.
template <class T>
void classify(const Lattice<T>& lattice, std::uint32_t z, T smallest, SignPlane& plane);

// The signs of the eight corners of 64 cells of a row: word c holds corner c of each.
using CornerWords = std::array<Word, 8>;

// Bit i of byte j of the result is bit j of word i, for the 64 bits of eight words.
std::array<std::uint8_t, kWordBits> transpose(const std::array<Word, 8>& words);

// One row of cells: the four rows of signs around it, and which of its cells and edges there are.
// At the lattice's upper borders the rows beyond are missing; their signs are never used.
class CellRow {
 public:
  CellRow(const Dims& dims, Scheme scheme, const SignPlane& low, const SignPlane& high,
          std::uint32_t y, std::uint32_t z);

  // Quick test on the signs alone: false when no sample of word w has a crossed edge.
  bool may_cross(std::size_t w) const;

  CornerWords corners(std::size_t w) const;

  // Word d: the samples whose edge of direction d exists and is crossed; word 0 is zero.
  std::array<Word, 8> crossed_edges(std::size_t w, const CornerWords& corners) const;

  // The cells that exist and have corners on both sides.
  Word crossed_cells(std::size_t w, const CornerWords& corners) const;

  // How many triangles these 64 cells have.
  unsigned count_triangles(std::size_t w, const CornerWords& corners) const;

  // The split of the cell at x.
  const CellSplit& split(std::uint32_t x) const { return (x & 1) != 0 ? *odd_x_ : *even_x_; }

 private:
  // The samples whose next neighbour along x exists.
  Word has_next(std::size_t w) const;

  const Word* rows_[4];  // at (y, z), (y + 1, z), (y, z + 1), (y + 1, z + 1)
  std::uint32_t last_x_;
  bool has_y_;
  bool has_z_;
  bool five_;
  Word even_;                // the row's samples of even x + y + z
  const CellSplit* even_x_;  // the split of the row's cells at even x
  const CellSplit* odd_x_;
};

}  // namespace isomesh::mesh
