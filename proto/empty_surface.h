// A mesh without triangles: the one place that says why, and that this is an error unless it is
// accepted.
#pragma once

#include <array>
#include <string>

#include "base/error.h"
#include "proto/mesh_summary.h"
#include "proto/parameters.h"

namespace isomesh {

// The samples of a volume, as its description tells them.
struct SampleValues {
  std::array<double, 2> range = {};
  double suggested_iso = 0;
};

// The reason why a mesh with these parameters is empty, and the way out where there is one. For a
// MeshSummary's `empty_reason`.
std::string why_empty(const MeshParameters& parameters, const MeshSummary& mesh,
                      const SampleValues& samples);

// The error that an empty mesh is, kEmptySurface. `way_out` says how its reader accepts the mesh,
// such as "allow_empty=true accepts that"; it may be empty.
Error empty_surface(const MeshSummary& mesh, const std::string& way_out);

}  // namespace isomesh
