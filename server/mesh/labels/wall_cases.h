// The walls between the labels in each tetrahedron of a cell; private to this folder.
//
// The walls in a tetrahedron depend only on which of its four corners have the same label. With two
// labels they are those of tetrahedra.h. In a face with three different labels, walls meet at a
// point of that face. In a tetrahedron with four, they meet at a centre of it:
//  * three labels, at corners a, a', b, c: one triangle between b and c, two between a and b and
//    two between a and c, around the line from the point of face abc to that of face a'bc;
//  * four labels: two triangles for each of the six pairs of corners, around the four lines from
//    the points of the faces to the centre.
//
// A vertex is named by the sample that owns its edge, face or tetrahedron, which is the corner
// whose offsets are the smallest along every axis, and by a slot of that sample.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "proto/types.h"
#include "server/mesh/lattice/tetrahedra.h"

namespace isomesh::mesh {

// The slots of a sample. Those of edges are their directions, as in tetrahedra.h: seven, six in the
// five-way split. Faces have twelve, or ten; tetrahedra six, or five.
inline constexpr std::size_t kFaceSlot = 8;
inline constexpr std::size_t kTetrahedronSlot = 20;
inline constexpr std::size_t kSlots = 26;
inline constexpr std::size_t kSlotPlaces = 32;  // what slots are counted in, for each sample

// The corners of what a slot of corner 0 is for, in the order of their numbers: none where there is
// nothing in that slot.
struct Slot {
  std::uint8_t size = 0;
  std::array<std::uint8_t, 4> corners = {};

  // A bit for each corner.
  unsigned set() const {
    unsigned set = 0;
    for (std::size_t i = 0; i < size; ++i) set |= 1U << corners[i];
    return set;
  }
};

// Names a vertex of a cell: the corner whose sample owns it, times kSlotPlaces, plus its slot.
using VertexName = std::uint8_t;

// A triangle of a wall, counter-clockwise seen from the side of the corner `front` in a
// right-handed lattice; the corner `back` is on the other side.
struct WallTriangle {
  std::array<VertexName, 3> vertices = {};
  std::uint8_t back = 0;
  std::uint8_t front = 0;
};

struct TetrahedronWalls {
  std::uint8_t triangles = 0;
  std::array<WallTriangle, 12> walls = {};
};

// A pattern tells which of a tetrahedron's corners have different labels: one bit for each of the
// pairs 01, 02, 03, 12, 13 and 23.
inline constexpr std::size_t kPatterns = 64;

template <class Label>
constexpr unsigned pattern_of(const std::array<Label, 4>& labels) {
  const auto [a, b, c, d] = labels;
  return (a != b ? 1U : 0U) | (a != c ? 2U : 0U) | (a != d ? 4U : 0U) | (b != c ? 8U : 0U) |
         (b != d ? 16U : 0U) | (c != d ? 32U : 0U);
}

// The walls in cells of one way of splitting.
struct WallCases {
  std::array<Slot, kSlots> slots = {};  // of corner 0
  // For each set of axes along which a sample has a next one (bit 0: x), the set of its slots that
  // exist.
  std::array<std::uint32_t, 8> existing = {};
  // The walls of each tetrahedron, in the order of CellSplit, then by pattern.
  std::array<std::array<TetrahedronWalls, kPatterns>, 6> tetrahedra = {};
};

// For a lattice of that hand, the cells whose corner 0 has even or odd i+j+k.
WallCases make_wall_cases(Scheme scheme, bool odd, bool left_handed);

}  // namespace isomesh::mesh
