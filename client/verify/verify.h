// Holds a mesh against the surface of a volume.
#pragma once

#include <string>

#include "client/verify/field.h"
#include "client/verify/surface.h"

namespace isomesh::verify {

struct Question {
  double bound = 0;         // in millimetres
  bool is_closed = false;   // an open edge is a fault also on the border of the volume
  bool some_parts = false;  // components of the surface may be missing as a whole
};

struct Verdict {
  bool holds = false;
  std::string text;  // lines for a person
};

// Holds if every point of each surface is within the bound of the other one, the edges of the mesh
// fit together, and no component of it is turned inside out. `surface` is the field's zero set.
// Both surfaces are reordered.
Verdict verify(Surface& mesh, Surface& surface, const Field& field, const Question& question);

}  // namespace isomesh::verify
