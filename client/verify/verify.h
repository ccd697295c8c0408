// Holds a mesh against the surface of a volume.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "client/verify/field.h"

namespace isomesh::verify {

// The triangles in LPS millimetres: of binary or ASCII STL, or of PLY or GLB without a codec as
// isomesh writes them. STL and PLY say if they are in RAS. Points with equal coordinates become
// one. Memory is bounded by the bytes, whatever they say. Throws Error kInvalidParameter for other
// bytes, truncated ones, and coordinates that are not finite.
Surface read_surface(std::string_view bytes);

// The parameters of the job, which GLB files of isomesh carry. None for other files. Throws as
// read_surface.
std::optional<MeshParameters> read_parameters(std::string_view bytes);

struct Question {
  double bound = 0;                 // in millimetres
  bool is_closed = false;           // an open edge is a fault also on the border of the volume
  ComponentFilter components = {};  // which components of the surface the mesh must have
};

struct Verdict {
  bool holds = false;
  std::string text;  // lines for a person
};

// Holds if every point of each surface is within the bound of the other one, the edges of the mesh
// fit together, and no component of it is inside out. `surface` is the field's zero set; components
// that the filter leaves out are removed.
Verdict verify(Surface& mesh, Surface& surface, const Field& field, const Question& question);

}  // namespace isomesh::verify
