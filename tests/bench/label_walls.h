// The surfaces of all labels as whoever made them leaves them, and how they share out space.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/labels/separate.h"
#include "server/mesh/mesh.h"
#include "tests/bench/samples.h"

namespace isomesh::bench {

// Triangles that have a label on one side or one on each. A wall that two labels share may be there
// once, with both, or once for each of them.
struct Walls {
  std::vector<mesh::Vec3> positions;  // millimetres
  std::vector<mesh::Triangle> triangles;
  std::vector<mesh::WallSides> sides;  // of each triangle; 0 is the background
};

struct Probe {
  std::array<double, 3> at;  // millimetres
  // No sample of its cell and of those around it is background.
  bool is_within_labels = false;
};

// So many points near walls: in the cells whose corners do not all have one label, evenly among
// those cells and within each. Deterministic. `labels` is ascending; all other values are
// background. For integer types; the directions of the geometry are taken for the identity. Throws
// std::runtime_error when there is no such cell.
std::vector<Probe> probes_near_walls(const Samples& samples, std::span<const std::int64_t> labels,
                                     std::size_t count);

// A point is in a label when a ray from it crosses the label's surface an odd number of times.
struct Sharing {
  std::uint64_t points = 0;
  std::uint64_t points_within_labels = 0;
  // Points within labels that no label's surface contains. Near the background such a point is not
  // a gap.
  std::uint64_t gaps = 0;
  std::uint64_t overlaps = 0;  // of all points, those that are in more than one
};

// The surface of each label must be closed.
Sharing measure_sharing(const Walls& walls, std::span<const Probe> probes);

// Volumes in mm3 that the labels' surfaces enclose, indexed by the label's number minus one.
// Triangles are counter-clockwise seen from `front`.
std::vector<double> enclosed_volumes(const Walls& walls, std::size_t labels);

}  // namespace isomesh::bench
