// The walls between labels while their stairs are removed; private to this folder.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "server/mesh/labels/wall_fans.h"
#include "server/mesh/lattice/lattice.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh {

// A point or a way, in the fourth lane zero.
using Lanes = float __attribute__((vector_size(16)));

inline float dot(Lanes a, Lanes b) {
  const Lanes product = a * b;
  return product[0] + product[1] + product[2];
}

inline Lanes rotated(Lanes lanes) { return __builtin_shufflevector(lanes, lanes, 1, 2, 0, 3); }

// The cross product before its lanes are rotated, which a sum of many needs only once.
inline Lanes twisted_cross(Lanes a, Lanes b) { return a * rotated(b) - rotated(a) * b; }
inline Lanes cross(Lanes a, Lanes b) { return rotated(twisted_cross(a, b)); }

inline Lanes smaller(Lanes a, Lanes b) { return a < b ? a : b; }
inline Lanes larger(Lanes a, Lanes b) { return a > b ? a : b; }
inline float length(Lanes a) { return std::sqrt(dot(a, a)); }

// Places are along the lattice's axes, as if those were orthogonal, in one unit near the steps
// (unit_mm): walls multiply lengths in single precision. Threads may read it while none writes.
class WallShape {
 public:
  // `surface` as extracted; `closed` as SeparateOptions says.
  WallShape(const SeparatingSurface& surface, const Dims& dims, const LatticeToSpace& to_space,
            bool closed, const Context& context);

  std::size_t vertices() const { return start_.size(); }
  const WallFans& fans() const { return fans_; }

  // Runs of vertices of whole layers, for in_waves: where they begin, and where the last ends.
  std::span<const std::size_t> blocks() const { return blocks_; }

  // The positions of the vertices at the start, and now.
  const Buffer<Lanes>& start() const { return start_; }
  Buffer<Lanes> at;

  // Signed: negative along x in a left-handed lattice, which is mirrored.
  Lanes spacing() const { return spacing_; }
  float largest_spacing() const { return largest_spacing_; }
  float smallest_spacing() const { return smallest_spacing_; }
  bool is_closed() const { return closed_; }

  // True where three or more walls meet, or one ends, or one leaves a cap.
  bool is_curve(std::size_t v) const { return (flags_[v] & kCurve) != 0; }
  // In a cap, or in the border of the volume.
  bool is_held(std::size_t v) const { return (flags_[v] & kAxes) != 0; }

  // The way without what would lead out of that.
  Lanes kept(std::size_t v, Lanes way) const {
    if (!is_held(v)) return way;
    for (int axis = 0; axis < 3; ++axis) {
      if ((flags_[v] >> axis & 1) != 0) way[axis] = 0;
    }
    return way;
  }

  // Moves a vertex back until each coordinate is within so many samples of the start, and within
  // the volume. Only held vertices come nearer to its border or to caps than a tenth of a sample.
  void hold(std::size_t v, float samples) {
    const Lanes low = smaller(start_[v], low_ + 0.1F * sample_);
    const Lanes high = larger(start_[v], high_ - 0.1F * sample_);
    at[v] = smaller(larger(at[v], larger(low, start_[v] - samples * sample_)),
                    smaller(high, start_[v] + samples * sample_));
  }

  // The neighbours of a vertex on a curve are those along it.
  const NeighborLists& neighbors() const { return neighbors_; }

  // Calls visit(fan, a, b) for all triangles at a vertex and their other corners.
  template <class Visit>
  void visit_triangles(std::size_t v, Visit visit) const {
    for (std::size_t fan = fans_.begin(v); fan < fans_.begin(v + 1); ++fan) {
      fans_.visit_triangles(fan, std::identity(),
                            [&](std::uint32_t a, std::uint32_t b) { visit(fan, a, b); });
    }
  }

  // The mean over the neighbours; there must be at least one.
  template <class Value>
  Value mean(std::size_t v, const Buffer<Value>& values) const {
    return neighbors_.sum(v, values) / static_cast<float>(neighbors_.degree(v));
  }

  // Calls visit(normal) for the triangles of a fan. Normals, whose lengths are twice the areas, are
  // yet to be rotated; so is their sum, which is returned.
  template <class Visit>
  Lanes visit_normals(std::size_t fan, const Visit& visit) const {
    const Lanes own = at[fans_.vertex(fan)];
    Lanes sum = {};
    fans_.visit_triangles(
        fan, [&](std::uint32_t v) { return at[v] - own; },
        [&](Lanes a, Lanes b) {
          const Lanes normal = twisted_cross(a, b);
          visit(normal);
          sum += normal;
        });
    return sum;
  }

 private:
  static constexpr std::uint8_t kAxes = 7;  // along which a vertex does not move, a bit each
  static constexpr std::uint8_t kCurve = 8;

  void place(const SeparatingSurface& surface, const Dims& dims, const LatticeToSpace& to_space,
             const Context& context);
  void find_neighbors(const Context& context);
  void list_along_curves(std::size_t v, std::vector<std::uint32_t>& found) const;

  const bool closed_;
  Lanes spacing_ = {};
  float largest_spacing_ = 0;
  float smallest_spacing_ = 0;
  Lanes sample_ = {};  // the spacing without a sign
  // Opposite corners of the box of the outermost samples or, if closed, of the caps.
  Lanes low_ = {};
  Lanes high_ = {};
  std::vector<std::size_t> blocks_;
  Buffer<Lanes> start_;
  Buffer<std::uint8_t> flags_;
  WallFans fans_;
  NeighborLists neighbors_;
};

}  // namespace isomesh::mesh
