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
#include <span>

#include "proto/types.h"

namespace isomesh::mesh {

inline constexpr std::size_t kMostTriangles = 12;  // two in each of six tetrahedra

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
  std::array<std::array<std::uint8_t, 4>, 6> corners = {};  // of each tetrahedron
  std::size_t tetrahedra = 0;
  std::array<CellCase, 256> cases = {};
  // The edges that corner 0 owns, by direction: the corners that each joins, and for each case the
  // set (bit d: direction d) of those that the surface crosses.
  std::array<EdgeEnds, 8> ends = {};
  std::array<std::uint8_t, 256> crossed = {};
};

// The surface in a single tetrahedron of a cell. The set `inside` (bit c: corner c) has its inside
// corners.
CellCase tetrahedron_case(const std::array<std::uint8_t, 4>& corners, unsigned inside);

// The split of a cell whose corner 0 has even or odd i+j+k; equal for six tetrahedra. On the
// body-centred lattice: the six-way split of cells without a centre (bcc_faces.h).
const CellSplit& cell_split(Scheme scheme, bool odd);

}  // namespace isomesh::mesh
