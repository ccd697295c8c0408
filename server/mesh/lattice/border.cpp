#include "server/mesh/lattice/border.h"

#include <algorithm>

#include "proto/samples.h"

namespace isomesh::mesh {
namespace {

// The surface keeps this many times the least distance from the border's samples. Vertices of the
// cap lie in between, at half of it and, where they give way, at an eighth.
constexpr double kContourWays = 8;
constexpr double kWayWithinCap = 0.2;
constexpr double kMostLeastWay = 0.25 / kContourWays;
// Simplification puts vertices on a grid of 65536 places to a step, which keeps two apart that are
// two places apart.
constexpr double kLeastWay = 2.0 / 65536;

double least_way(double nearest) { return std::clamp(nearest, kLeastWay, kMostLeastWay); }

bool is_odd(std::int64_t number) { return (number & 1) != 0; }

std::array<std::int64_t, 3> corner_offset(unsigned corner) {
  return {corner & 1, corner >> 1 & 1, corner >> 2};
}

}  // namespace

double nearest_on_border(double nearest) { return kContourWays * least_way(nearest); }

template <class T>
BorderPlacement<T>::BorderPlacement(const Lattice<T>& lattice, const ExtractOptions& options,
                                    const Threshold<T>& threshold, const Placement& interior)
    : lattice_(lattice),
      dims_{lattice.dims.x, lattice.dims.y, lattice.dims.z},
      five_(options.scheme == Scheme::kFive),
      threshold_(threshold),
      interior_(interior),
      least_way_(least_way(interior.nearest())),
      contour_(options, nearest_on_border(interior.nearest())) {}

template <class T>
BorderVertex BorderPlacement<T>::place(const BorderSample& cell, const EdgeEnds& ends) const {
  const Offset start = corner_offset(ends.from);
  const Offset end = corner_offset(ends.to);
  Sample from;
  Sample to;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    from[axis] = cell[axis] + start[axis];
    to[axis] = cell[axis] + end[axis];
  }
  const LatticeToSpace& map = lattice_.to_space;
  BorderVertex vertex;
  if (is_phantom(from) || is_phantom(to)) {
    vertex.on_border = true;
    const Point at = is_phantom(from) ? cap_point(to, from) : cap_point(from, to);
    for (std::size_t i = 0; i < 3; ++i) {
      vertex.position[i] = static_cast<float>(map.origin[i] + map.step_x[i] * at[0] +
                                              map.step_y[i] * at[1] + map.step_z[i] * at[2]);
    }
    return vertex;
  }
  vertex.on_border = share_a_face(from, to);
  const double share = (vertex.on_border ? contour_ : interior_).share(value(from), value(to));
  const auto number = [](std::int64_t whole) { return static_cast<double>(whole); };
  for (std::size_t i = 0; i < 3; ++i) {
    // The same operations in the same order as away from the border, for the same bits.
    const auto offset = [&](const Offset& corner) {
      return map.step_x[i] * number(corner[0]) + map.step_y[i] * number(corner[1]) +
             map.step_z[i] * number(corner[2]);
    };
    const double row =
        map.origin[i] + map.step_y[i] * number(cell[1]) + map.step_z[i] * number(cell[2]);
    const double at = row + map.step_x[i] * number(cell[0]);
    vertex.position[i] =
        static_cast<float>(at + offset(start) + (offset(end) - offset(start)) * share);
  }
  return vertex;
}

template <class T>
bool BorderPlacement<T>::is_phantom(const Sample& sample) const {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (sample[axis] < 0 || sample[axis] >= dims_[axis]) return true;
  }
  return false;
}

template <class T>
T BorderPlacement<T>::value(const Sample& sample) const {
  return lattice_.samples[(sample[2] * dims_[1] + sample[1]) * dims_[0] + sample[0]];
}

template <class T>
bool BorderPlacement<T>::is_inside(const Sample& sample) const {
  return threshold_.contains(value(sample));
}

// The side of the sample's phantom neighbour along the axis; 0 if there is none.
template <class T>
std::int64_t BorderPlacement<T>::outward(const Sample& sample, std::size_t axis) const {
  if (sample[axis] == 0) return -1;
  return sample[axis] == dims_[axis] - 1 ? 1 : 0;
}

template <class T>
bool BorderPlacement<T>::share_a_face(const Sample& a, const Sample& b) const {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (a[axis] == b[axis] && outward(a, axis) != 0) return true;
  }
  return false;
}

template <class T>
bool BorderPlacement<T>::all_around_is_inside(const Sample& sample) const {
  Sample low;
  Sample high;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    low[axis] = std::max<std::int64_t>(sample[axis] - 1, 0);
    high[axis] = std::min(sample[axis] + 1, dims_[axis] - 1);
  }
  for (std::int64_t z = low[2]; z <= high[2]; ++z) {
    for (std::int64_t y = low[1]; y <= high[1]; ++y) {
      for (std::int64_t x = low[0]; x <= high[0]; ++x) {
        if (!is_inside({x, y, z})) return false;
      }
    }
  }
  return true;
}

// True if the split of the cells has an edge there (tetrahedra.h).
template <class T>
bool BorderPlacement<T>::has_edge(const Sample& from, const Offset& offset) const {
  if (five_) {
    const auto axes = 3 - std::ranges::count(offset, 0);
    return axes == 1 || (axes == 2 && !is_odd(from[0] + from[1] + from[2]));
  }
  return std::ranges::min(offset) >= 0 || std::ranges::max(offset) <= 0;
}

// The least share of the diagonals from `inside`, in squares of the box's faces beside the edge to
// `neighbor`, at which the surface crosses them; 1 without crossings.
template <class T>
double BorderPlacement<T>::nearest_diagonal_share(const Sample& inside,
                                                  const Sample& neighbor) const {
  double least = 1;
  for (std::size_t face = 0; face < 3; ++face) {
    if (inside[face] != neighbor[face] || outward(inside, face) == 0) continue;
    const std::size_t along = inside[0] != neighbor[0] ? 0 : inside[1] != neighbor[1] ? 1 : 2;
    const std::size_t across = 3 - face - along;
    for (const std::int64_t side : {-1, 1}) {
      Sample opposite = neighbor;
      opposite[across] += side;
      if (is_phantom(opposite) || is_inside(opposite)) continue;
      least = std::min(least, contour_.share(value(inside), value(opposite)));
    }
  }
  return least;
}

// The edge from `inside` to a phantom lies in the face of the box across `axis`. Its vertex would
// coincide with those of the other edges from `inside` to phantoms beyond other faces (border.h).
// One vertex stays on the face; this decides if this vertex moves off it. The one that stays is
//  * on an edge of the box: the vertex to the phantom beyond both faces or, if the split has no
//    such edge, beyond the face of the smaller axis;
//  * on a corner of the box: the vertex to the phantom beyond all three faces, or beyond x and one
//    of the others, or beyond x.
template <class T>
bool BorderPlacement<T>::gives_way(const Sample& inside, const Offset& to_phantom,
                                   std::size_t axis) const {
  Offset beyond_both = to_phantom;
  beyond_both[axis] = outward(inside, axis);
  if (has_edge(inside, beyond_both)) return true;

  std::array<bool, 3> leaves = {};  // the faces that the phantom is beyond
  for (std::size_t a = 0; a < 3; ++a) {
    leaves[a] = to_phantom[a] != 0 && to_phantom[a] == outward(inside, a);
  }
  const std::size_t first = leaves[0] ? 0 : leaves[1] ? 1 : 2;
  if (axis < first) return true;
  if (std::ranges::count(leaves, true) == 1 || axis == 2) return false;
  return has_edge(inside, {outward(inside, 0), outward(inside, 1), 0});
}

template <class T>
typename BorderPlacement<T>::Point BorderPlacement<T>::cap_point(const Sample& inside,
                                                                 const Sample& phantom) const {
  Sample nearest;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    nearest[axis] = std::clamp<std::int64_t>(phantom[axis], 0, dims_[axis] - 1);
  }
  double share = 0;
  if (nearest != inside) {
    share = is_inside(nearest) ? 0.5 : contour_.share(value(inside), value(nearest)) / 2;
    if (five_) share = std::min(share, nearest_diagonal_share(inside, nearest));
  }
  Offset to_phantom;
  Point point;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    to_phantom[axis] = phantom[axis] - inside[axis];
    point[axis] = static_cast<double>(inside[axis]) +
                  static_cast<double>(nearest[axis] - inside[axis]) * share;
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::int64_t out = outward(inside, axis);
    if (out == 0 || to_phantom[axis] != 0 || !gives_way(inside, to_phantom, axis)) continue;
    const bool is_within = all_around_is_inside(inside) || all_around_is_inside(nearest);
    const double way = is_within ? kWayWithinCap : least_way_;
    point[axis] -= static_cast<double>(out) * way;
  }
  return point;
}

#define ISOMESH_INSTANTIATE(Sample, name, kType) template class BorderPlacement<Sample>;
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::mesh
