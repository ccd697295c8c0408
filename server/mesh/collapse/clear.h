// Tests whether F has one sign on a whole triangle, for every collapse; private to this folder.
//
// F is linear on each piece that the tetrahedra cut out of a triangle. So its sign on the triangle
// is that at the corners of the pieces. A corner of a piece lies where three planes meet, the
// triangle's own among them, or on the triangle's boundary. So the corners are
//   1. the triangle's own corners: point(),
//   2. the places where one of its edges crosses a plane: edge(),
//   3. the places where a line in which planes meet crosses it: inside().
// On such a line F is linear between one sample, or centre, and the next.
//
// Places lie on a grid of 2^-16 voxels (tube.h) and are counted from a sample nearby. So the
// numbers of planes are exact in single precision. Two such numbers tell how a line passes the
// triangle's edges by the signs of areas, and those are exact in double precision.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "server/mesh/collapse/field.h"
#include "server/mesh/collapse/planes.h"
#include "server/mesh/collapse/vec.h"

namespace isomesh::mesh::collapse {

// Not thread safe: one for each thread. `field` must outlive it.
template <class Planes>
class Clear {
 public:
  using PlaneNumbers = typename Planes::Numbers;

  explicit Clear(const Field& field);

  // Sets the origin of at() to a sample before `a`, which must be within the volume. Returns that
  // sample.
  Vecf base(Vecf a);
  PlaneNumbers at(Vecf a) const { return Planes::numbers(a - base_); }
  double value(const PlaneNumbers& a) const { return value(Vecd{a.of[0], a.of[1], a.of[2]}); }

  // True if sign * F is positive: at a point, along an edge, inside a triangle. Ends and edges are
  // left out, since the other tests cover them.
  bool point(const PlaneNumbers& a, double sign);
  bool edge(const PlaneNumbers& a, const PlaneNumbers& b, double sign);
  bool inside(const PlaneNumbers& a, const PlaneNumbers& b, const PlaneNumbers& c, double sign);
  // The value of sign * F at which the last test failed.
  double failed() const { return failed_; }

  // The same at one corner: where the edge crosses the plane of that number of a family, and where
  // the line i, j of a direction crosses the triangle, if it does.
  bool crossing(const PlaneNumbers& a, const PlaneNumbers& b, std::size_t family, double plane,
                double sign);
  bool line(const PlaneNumbers& a, const PlaneNumbers& b, const PlaneNumbers& c,
            std::size_t direction, double i, double j, double sign);

  const float* at_base() const { return at_base_; }

 private:
  struct LineSteps {
    std::ptrdiff_t first, second, along;
  };

  double value(Vecd place) const;
  bool is_positive(double value);

  const Field& field_;
  const SampleSteps steps_;
  std::array<LineSteps, Planes::kLines.size()> lines_;
  Vecf base_;
  const float* at_base_ = nullptr;
  double failed_ = 0;
};

extern template class Clear<SixPlanes>;
extern template class Clear<FivePlanes>;
extern template class Clear<BccPlanes>;

}  // namespace isomesh::mesh::collapse
