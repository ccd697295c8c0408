// Fewer triangles for a surface at an iso-value, within a distance of it that is proven for every
// point, both ways.
//
// The surface that is simplified carries two copies of itself, one wholly inside the surface as the
// samples define it and one wholly outside, whose vertices are within the distance of its own.
// Edges are collapsed while that stays so. proof.h has the proof, which is done again at the end
// with other code.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "server/mesh/context.h"
#include "server/mesh/lattice/placement.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

struct BoundOptions {
  double max_error_mm = 0;  // more than 0
  // How far coordinates of files may be from those of the mesh: the part of the error that stays
  // unused here.
  double rounding_mm = 0;
  // Enough are gone when there are so many; 0: as few as the error allows.
  std::uint64_t triangles = 0;
  bool is_smoothed = false;  // whether the mesh's vertices left their lattice edges
};

// A mesh that is within a distance of the surface.
struct BoundedMesh {
  std::uint64_t triangles_before = 0;
  double bound_mm = 0;  // of the mesh as it is, not rounded
  // How far the samples in single precision, which the copies were compared with, move the surface.
  // Part of the bound.
  double shift_mm = 0;
  // The position of each vertex in the two copies, in millimetres.
  std::vector<std::array<double, 3>> inside;
  std::vector<std::array<double, 3>> outside;

  // The bound where the vertex v lies at places[v] instead.
  double bound_at(std::span<const Vec3> places) const;
};

// Simplifies `mesh` in place, which SurfaceWindows made of the lattice with these options, and
// which may have lost components (Mesh::kept) and have been smoothed since, by less than the error.
// Distances are those from the surface without these components. Its boundary stays on the faces
// of the volume and keeps its vertices; the caps of a closed one stay in the faces. The mesh keeps
// its topology where components are larger than the error, and what Mesh says of layers. The same
// mesh for any number of threads.
//
// Nothing where that cannot be proven, because the surface was regularised, single precision does
// not tell the samples apart or parts of the surface are missing; then the mesh is as it was.
// Beside the mesh it takes some 250 bytes a triangle, for each thread what writing a surface takes
// (windows.h), and proving_memory. Throws Error kCancelled.
template <class T>
std::optional<BoundedMesh> simplify_within(const Lattice<T>& lattice, const ExtractOptions& extract,
                                           const BoundOptions& options, const Context& context,
                                           Mesh& mesh);

// The memory of the samples as it reads them, in bytes: at most, but for planes that are much
// longer than wide. Around a closed volume there are layers of others, whose number the error
// tells. The volume has so many planes of so many samples each.
std::uint64_t proving_memory(const ExtractOptions& extract, std::uint64_t planes,
                             std::uint64_t plane_samples);

}  // namespace isomesh::mesh
