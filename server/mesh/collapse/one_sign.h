// The sign of F on a surface, in double precision; private to this folder. It shares no code with
// Clear, which collapses ask.
//
// All planes between tetrahedra belong to families (planes.h). Two planes meet the triangle in a
// corner of a piece only where their common line crosses it. Each line lies in a plane of one of a
// few families, the cutting ones. So the corners in a triangle lie on the segments that cutting
// planes leave of it, and they are where planes of some other families cross the segments.
#pragma once

#include "server/mesh/collapse/field.h"
#include "server/mesh/collapse/vec.h"

namespace isomesh::mesh::collapse {

// Immutable. `field` must outlive it.
class OneSign {
 public:
  OneSign(const Field& field, double sign) : field_(field), sign_(sign) {}

  // True if sign * F is positive. at(): at a place, false outside the volume. along(): all along an
  // edge between two such places. within(): all over a triangle whose edges are such.
  bool at(Vecd p) const;
  bool along(Vecd p, Vecd q) const;
  bool within(Vecd a, Vecd b, Vecd c) const;

 private:
  const Field& field_;
  const double sign_;
};

}  // namespace isomesh::mesh::collapse
