// The shares of a job's error.
#pragma once

#include <cstddef>
#include <vector>

#include "proto/types.h"
#include "server/mesh/mesh.h"
#include "server/mesh/smooth/untangle.h"

namespace isomesh::jobs {

// At an iso-value, `max_error_mm` counts from the extracted surface: smoothing may use half,
// rounding coordinates a tenth, and simplification the rest. For labels it counts from the smoothed
// surface, because less smoothing would take their volume (docs/labels.md). So simplification has
// nine tenths.

// True if the job asks for fewer triangles.
bool is_simplified(const MeshParameters& parameters);

// The surface that the error counts from.
MeshCertificate::Reference error_reference(const MeshParameters& parameters);

// The farthest that smoothing may move a vertex; infinite if nothing limits it.
double most_displacement(const MeshParameters& parameters);

// The parameters with enough bits for Draco's coordinates to keep the error, and at least those of
// the request. They suffice after the mesh was simplified, too. Throws Error kInvalidParameter,
// field "max_error_mm", if Draco has too few.
MeshParameters with_bits_for(const MeshParameters& parameters, const mesh::Mesh& mesh);

// The most that rounding to the files' coordinates moves a point of the mesh, in millimetres: half
// the diagonal of a cell of Draco's grid, and the resolution of single precision. Also after
// vertices were moved by `moved_mm`, which enlarges the grid.
double quantisation_mm(const MeshParameters& parameters, const mesh::Mesh& mesh,
                       double moved_mm = 0);

// True if a file of the job rounds coordinates, or if one does not.
bool has_rounded_files(const MeshParameters& parameters);
bool has_exact_files(const MeshParameters& parameters);

// How files that round have the positions of the mesh.
mesh::Rounding rounding_of(const MeshParameters& parameters, const mesh::Mesh& mesh);

// A certificate measures no more points of each surface if the limit is proven: what is found is
// then only told beside it.
inline constexpr std::size_t kMostPointsBesideAProof = std::size_t{1} << 16;

// The formats that a certificate measures, in the files' order: each that rounds coordinates, and
// the first of the exact ones, which all hold the mesh itself.
std::vector<MeshFormat> measured_formats(const MeshParameters& parameters);

}  // namespace isomesh::jobs
