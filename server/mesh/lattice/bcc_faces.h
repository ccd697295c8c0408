// The body-centred cubic lattice: how space is split into tetrahedra between the samples and the
// centres of the cells, and what the surface looks like around a face of a cell.
//
// A centre has the mean of its cell's eight samples. Two centres whose cells share a face, and two
// samples that share an edge of that face, form a tetrahedron: four around each face. A face in the
// border of the volume has one centre only. Its square is cut from its low to its high corner, as
// in the six-way split, and each half forms a tetrahedron with the centre.
//
// Each sample has a record, shared with the cell whose corner 0 it is. Its edges are slots:
//  *  0-7:  from the cell's centre to its corner 0..7 (tetrahedra.h);
//  *  8-10: from the sample to the next one along x, y, z;
//  * 11-13: from the centre to the next one along x, y, z;
//  * 14-16: the diagonal of the square whose corner 0 is the sample, normal to x, y, z, where the
//           square is not between two centres.
// A cell with a phantom among its corners (border.h) has no centre. It is split into six, and slot
// 0 is its diagonal.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "server/mesh/lattice/tetrahedra.h"

namespace isomesh::mesh {

inline constexpr unsigned kBccSlots = 17;
// What slots are counted in, for each sample: a power of two, because places are split again.
inline constexpr unsigned kBccPlaces = 32;
inline constexpr unsigned kBccAxisSlot = 8;
inline constexpr unsigned kBccCentreSlot = 11;
inline constexpr unsigned kBccDiagonalSlot = 14;

// The slot of the edge of direction 1..7 that a sample owns in the six-way split.
constexpr unsigned bcc_slot_of(unsigned direction) {
  constexpr std::array<std::uint8_t, 8> kSlots = {0, 8, 9, 16, 10, 15, 14, 0};
  return kSlots[direction];
}

// The direction 1..7 of a slot whose edge joins two samples.
constexpr unsigned bcc_direction_of(unsigned slot) {
  if (slot == 0) return 7;
  return slot < kBccCentreSlot ? 1U << (slot - kBccAxisSlot) : 7U ^ 1U << (slot - kBccDiagonalSlot);
}

// The records that a face names. `lower` and `upper` are the cells below and above it; the record
// of the upper cell is also that of the face's corner 0. `second` and `third` are the next ones
// along the two axes after the face's normal, in the cyclic order x, y, z.
enum class BccRecord : std::uint8_t { kLower, kUpper, kSecond, kThird };

struct BccEdge {
  BccRecord record = BccRecord::kLower;
  std::uint8_t slot = 0;
};

enum class BccSide : std::uint8_t {
  kInner,  // between two cells
  kLow,    // at the lower border: the upper cell's alone
  kHigh,   // at the upper border: the lower cell's alone
};

inline constexpr std::array kBccSides = {BccSide::kInner, BccSide::kLow, BccSide::kHigh};

// The sample that has the record, as a corner of the cell that writes the face's triangles: the
// lower one, or the upper one of a face at the lower border.
constexpr unsigned bcc_corner_of(BccRecord record, unsigned axis, BccSide side) {
  const unsigned plane = side == BccSide::kLow ? 0 : 1U << axis;
  switch (record) {
    case BccRecord::kLower:
      return 0;
    case BccRecord::kUpper:
      return plane;
    case BccRecord::kSecond:
      return plane | 1U << (axis + 1) % 3;
    case BccRecord::kThird:
      return plane | 1U << (axis + 2) % 3;
  }
  return 0;
}

// The triangles around a face by case and tetrahedron, whose corners are places in bcc_face_edges:
// places 2 t and 2 t + 1 are those of tetrahedron t, as far as there are so many. The last byte of
// each is idle. They are wound counter-clockwise seen from outside in a right-handed lattice,
// clockwise in a left-handed one.
//
// A case is a set of inside points: bit 0 the lower cell's centre, bit 1 the upper one's, bits 2-5
// the face's corners in cyclic order. At the border the missing centre has no meaning.
struct BccFace {
  std::array<std::array<std::array<std::uint8_t, 4>, 8>, 64> triangles = {};
  std::array<std::uint8_t, 64> present = {};  // for each case a bit for each place that has one
};

// The tetrahedra of a face by the points of a case.
inline constexpr std::array<Tetrahedron, 4> kBccInnerTetrahedra = {
    {{0, 1, 2, 3}, {0, 1, 3, 4}, {0, 1, 4, 5}, {0, 1, 5, 2}}};
// At the border point 0 stands for the only centre.
inline constexpr std::array<Tetrahedron, 2> kBccBorderTetrahedra = {{{0, 2, 3, 4}, {0, 2, 4, 5}}};

// The offsets of a face's corners from its corner 0, as corners of a cell.
constexpr std::array<unsigned, 4> bcc_corners(unsigned axis) {
  const unsigned second = 1U << (axis + 1) % 3;
  const unsigned third = 1U << (axis + 2) % 3;
  return {0, second, second | third, third};
}

// The place in bcc_face_edges of the edge between two points of a face.
constexpr std::size_t bcc_edge_between(unsigned a, unsigned b) {
  const unsigned low = a < b ? a : b;
  const unsigned high = a < b ? b : a;
  if (low < 2) return high == 1 ? 0 : low * 4 + high - 1;
  if (high - low == 2) return 0;
  return low == 2 && high == 5 ? 12 : low + 7;
}

// The edges of a face, by which the corners of its triangles are named: one between the centres
// or, at the border, the diagonal of the square; those from the lower centre to the corners, and
// from the upper one; and the sides of the square. At the border those of the missing centre have
// no meaning.
inline constexpr std::size_t kBccFaceEdges = 13;

constexpr std::array<BccEdge, kBccFaceEdges> bcc_face_edges(unsigned axis, BccSide side) {
  const auto slot = [](unsigned number) { return static_cast<std::uint8_t>(number); };
  const std::uint8_t second = slot(kBccAxisSlot + (axis + 1) % 3);
  const std::uint8_t third = slot(kBccAxisSlot + (axis + 2) % 3);
  std::array<BccEdge, kBccFaceEdges> edges = {};
  edges[0] = side == BccSide::kInner ? BccEdge{BccRecord::kLower, slot(kBccCentreSlot + axis)}
                                     : BccEdge{BccRecord::kUpper, slot(kBccDiagonalSlot + axis)};
  for (std::size_t c = 0; c < 4; ++c) {
    const unsigned corner = bcc_corners(axis)[c];
    edges[1 + c] = {BccRecord::kLower, slot(corner | 1U << axis)};
    edges[5 + c] = {BccRecord::kUpper, slot(corner)};
  }
  edges[9] = {BccRecord::kUpper, second};
  edges[10] = {BccRecord::kSecond, third};
  edges[11] = {BccRecord::kThird, second};
  edges[12] = {BccRecord::kUpper, third};
  return edges;
}

// Indexed by axis and BccSide.
using BccFaces = std::array<std::array<BccFace, 3>, 3>;

const BccFaces& bcc_faces(bool left_handed);

}  // namespace isomesh::mesh
