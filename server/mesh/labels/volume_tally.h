// Sums over the cells that tell where volume is missing; private to this folder.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "server/mesh/labels/label_slabs.h"
#include "server/mesh/labels/missing_volume.h"
#include "server/mesh/labels/wall_cases.h"

namespace isomesh::mesh {

// For each wall triangle of a tetrahedron (wall_cases.h), the missing volume at each of its
// corners, in voxels. It is owed to the label of the triangle's corner `back`.
using OwedVolumes = std::array<float, 12>;

// For cells of one way of splitting.
struct TallyCases {
  std::array<std::array<OwedVolumes, kPatterns>, 6> tetrahedra = {};
  // The position of each vertex before any are joined, from the cell's corner 0, in steps of the
  // lattice.
  std::array<std::array<float, 3>, 8 * kSlotPlaces> places = {};
};

// Returns the cases by parity.
std::array<TallyCases, 2> make_tally_cases(Scheme scheme, const std::array<WallCases, 2>& walls);

struct VolumeTally {
  // Sums of whole numbers do not depend on the order in which threads add to them.
  static constexpr double kUnit = 0x1p-32;  // voxels

  SeparatingSurface& surface;
  const WallFans& fans;
  const std::array<TallyCases, 2>& cases;
  std::span<const std::array<double, 3>> indices;  // of each vertex, in the lattice
  std::span<std::int64_t> units;                   // by fan
};

void write_slab(const Separation& separation, const Slab& slab, IndexMemory& memory,
                VolumeTally& tally);

}  // namespace isomesh::mesh
