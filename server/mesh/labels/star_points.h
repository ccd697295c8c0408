// The points around a sample of the walls between labels: half-way on an edge to a neighbour, in a
// face with two neighbours, and in a tetrahedron with three; private to this folder.
//
// One of a point's samples owns its name (wall_cases.h). The point may be joined at the sample with
// the largest number, see label_clusters-inl.h.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "proto/types.h"
#include "server/mesh/extract/links.h"

namespace isomesh::mesh {

struct StarPoint {
  Directions neighbours = 0;  // of the point beside the sample: one, two or three
  // Those, ascending, and then the sample itself.
  std::array<std::uint8_t, 3> members = {kMostDirections, kMostDirections, kMostDirections};
  // The sample's corner in the cell of the name's owner, and the slot there.
  std::uint8_t corner = 0;
  std::uint8_t slot = 0;
  bool is_below = false;  // a sample of the plane below owns the name

  // The parity of that owner, if the sample's is this.
  unsigned owner_parity(unsigned parity) const {
    return (parity + static_cast<unsigned>(std::popcount(corner))) & 1;
  }
};

// Those on edges, by direction and with zeros where there is none; at most 48 in faces; at most 32
// centres.
using StarPoints = std::array<std::vector<StarPoint>, 3>;

// Those around samples of even and of odd parity.
const std::array<StarPoints, 2>& star_points(Scheme scheme);

}  // namespace isomesh::mesh
