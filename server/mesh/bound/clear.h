// Whether F has one sign on a whole triangle: what every collapse asks; private to this folder.
//
// F is linear on each piece that the tetrahedra cut out of a triangle, so its sign is that at the
// corners of the pieces. The planes of Kuhn's split are x, y, z, x-y, y-z, x-z = whole number, and
// they meet in the lines through samples in seven directions. So those corners are the triangle's
// own, the places where its edges cross a plane, and those where such a line crosses it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "server/mesh/bound/field.h"
#include "server/mesh/bound/tube.h"
#include "server/mesh/bound/vec.h"

namespace isomesh::mesh::bound {

// A point, by the numbers of the six families of planes, relative to Clear::base(). Exact within
// 128 voxels. The last two are of no family and never meet a plane.
struct alignas(32) PlaneNumbers {
  std::array<float, 8> of;
};

// Not thread safe: one for each thread. `field` must outlive it.
class Clear {
 public:
  explicit Clear(const Field& field);

  // What at() is relative to from now on: the sample before `a`, which is within the volume.
  void base(Vecf a);
  bool contains(Vecf a) const;
  PlaneNumbers at(Vecf a) const;
  double value(const PlaneNumbers& a) const { return value(a.of[0], a.of[1], a.of[2]); }

  // Whether sign * F is positive: at a point, between two points, and between three, each without
  // the ends and edges, which the others tell.
  bool point(const PlaneNumbers& a, double sign);
  bool edge(const PlaneNumbers& a, const PlaneNumbers& b, double sign);
  bool inside(const PlaneNumbers& a, const PlaneNumbers& b, const PlaneNumbers& c, double sign);
  // sign * F where the last of them found that it was not.
  double failed() const { return failed_; }

 private:
  struct Line;

  double value(double x, double y, double z) const;
  bool is_positive(double value);
  bool lines(const PlaneNumbers& a, const PlaneNumbers& b, const PlaneNumbers& c,
             std::size_t direction, const std::array<float, 8>& low,
             const std::array<float, 8>& high, double sign);

  const Field& field_;
  std::array<std::ptrdiff_t, 7> step_, first_, second_;  // by direction: along it, and to line i, j
  std::array<std::ptrdiff_t, 8> next_, before_last_;     // in a cell, by the order of x, y and z
  std::ptrdiff_t last_;
  Vecf base_;
  const float* at_base_ = nullptr;
  double failed_ = 0;
};

}  // namespace isomesh::mesh::bound
