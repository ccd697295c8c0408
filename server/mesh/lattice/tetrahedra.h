// Splits of a cell into tetrahedra, and the surface in each of a cell's 256 cases.
//
// A corner of a cell is a number 0..7 whose bits are its offsets along x, y and z. So is the
// direction 1..7 of an edge. The edge of direction d that belongs to a sample lies in the cell
// whose corner 0 is that sample, within the smallest face or cell that spans d there:
//  * six-way (Kuhn) split: from corner 0 to corner d; seven edges a sample;
//  * five-way split: the three axis edges, and one diagonal of each lower face (d = 3, 5, 6). The
//    diagonals join samples of even i+j+k: from corner 0 to corner d of an even sample, between the
//    two other corners of the face of an odd one. Direction 7 has no edge.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "proto/types.h"

namespace isomesh::mesh {

inline constexpr std::size_t kMostTriangles = 12;  // two in each of six tetrahedra

// The corners of a tetrahedron of a cell.
using Tetrahedron = std::array<std::uint8_t, 4>;

// Table 1 of Doi and Koide (see extract.h), whose corners 0..7 are 000 100 110 010 001 101 111 011.
template <std::size_t N>
constexpr std::array<Tetrahedron, N> from_paper(std::array<Tetrahedron, N> table,
                                                std::uint8_t mirror) {
  constexpr std::array<std::uint8_t, 8> kCorner = {0, 1, 3, 2, 4, 5, 7, 6};
  for (Tetrahedron& tetrahedron : table) {
    for (std::uint8_t& corner : tetrahedron) corner = kCorner[corner] ^ mirror;
  }
  return table;
}
inline constexpr std::array<Tetrahedron, 6> kSixTetrahedra = from_paper<6>(
    {{{0, 2, 3, 6}, {0, 1, 2, 6}, {0, 1, 5, 6}, {0, 3, 6, 7}, {0, 4, 6, 7}, {0, 4, 5, 6}}}, 0);
inline constexpr std::array<Tetrahedron, 5> kPaperFive = {
    {{0, 2, 3, 7}, {0, 1, 2, 5}, {0, 4, 5, 7}, {2, 5, 6, 7}, {0, 2, 5, 7}}};
// Cells of odd parity are mirrored along x.
inline constexpr std::array<Tetrahedron, 5> kFiveTetrahedraEven = from_paper(kPaperFive, 0);
inline constexpr std::array<Tetrahedron, 5> kFiveTetrahedraOdd = from_paper(kPaperFive, 1);

// Identifies an edge of a cell: eight times the corner whose sample owns it, plus its direction.
using EdgeName = std::uint8_t;

constexpr EdgeName edge_name(unsigned owner, unsigned direction) {
  return static_cast<EdgeName>(owner * 8 + direction);
}

// The surface in a cell whose corners in the case's bits are inside, wound counter-clockwise seen
// from outside in a right-handed lattice.
struct CellCase {
  std::uint8_t triangles = 0;
  std::array<std::array<EdgeName, 3>, kMostTriangles> edges = {};
};

// The two corners that an edge joins.
struct EdgeEnds {
  std::uint8_t from = 0;
  std::uint8_t to = 0;
};

// One split of a cell.
struct CellSplit {
  std::array<Tetrahedron, 6> corners = {};
  std::size_t tetrahedra = 0;
  std::array<CellCase, 256> cases = {};
  // The edges that corner 0 owns, by direction: the corners that each joins, and for each case the
  // set (bit d: direction d) of those that the surface crosses.
  std::array<EdgeEnds, 8> ends = {};
  std::array<std::uint8_t, 256> crossed = {};
};

// The surface in a single tetrahedron of a cell. The set `inside` (bit c: corner c) has its inside
// corners.
CellCase tetrahedron_case(const Tetrahedron& corners, unsigned inside);

// The triangles of the cases by tetrahedron: places 2 t and 2 t + 1 are those of tetrahedron t, as
// far as there are so many. The last byte of each place is idle.
inline constexpr std::size_t kTrianglePlaces = 16;
using PlacedTriangles = std::array<std::array<std::array<EdgeName, 4>, kTrianglePlaces>, 256>;
PlacedTriangles placed_triangles(const CellSplit& split);

// The split of a cell whose corner 0 has even or odd i+j+k; equal for six tetrahedra. On the
// body-centred lattice: the six-way split of cells without a centre (bcc_faces.h).
const CellSplit& cell_split(Scheme scheme, bool odd);

}  // namespace isomesh::mesh
