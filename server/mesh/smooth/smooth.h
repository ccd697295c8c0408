// Smoothing of a surface mesh: Laplacian (D. A. Field, "Laplacian smoothing and Delaunay
// triangulations", Communications in Applied Numerical Methods 4(6), 1988) and Taubin's (G. Taubin,
// "A signal processing approach to fair surface design", SIGGRAPH 1995).
//
// A step moves every free vertex by a fraction of the way to the mean of its neighbours, all from
// the positions after the previous step. A triangle of layer k names only vertices of layers k and
// k + 1, so a step needs only three layers of the previous step. So several steps run through the
// layers together, each one layer behind the previous one, and only the layers between the first
// and the last step are held beside the mesh.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "server/mesh/context.h"
#include "server/mesh/extract/extract.h"
#include "server/mesh/lattice/lattice.h"
#include "server/mesh/measure/measure.h"
#include "server/mesh/mesh.h"
#include "server/mesh/smooth/methods.h"

namespace isomesh::mesh {

// The points p with normal . p <= offset, in millimetres; the normal has length 1.
struct HalfSpace {
  std::array<double, 3> normal = {0, 0, 0};
  double offset = 0;
};

struct SmoothOptions {
  // The steps of all passes, in order. Either all are means, or all go along the surface.
  std::vector<Step> steps = {};
  AtCurves at_curves = AtCurves::kAlong;
  // No vertex is ever farther than this from its extracted position. Millimetres, 0 or more.
  double max_displacement_mm = std::numeric_limits<double>::infinity();
  // Keeps free vertices within these. Steps other than to the mean need it next to caps.
  std::vector<HalfSpace> within = {};

  // True if a step may lead away from the neighbours.
  bool goes_outwards() const;
};

// The box of a lattice's samples, wider on each side by this fraction of a step.
std::vector<HalfSpace> box_around(const LatticeToSpace& to_space, const Dims& dims, double wider);

// The effect of smoothing on a surface.
struct SmoothingEffect {
  Extent before;
  Extent after;
  double mean_displacement_mm = 0;  // of all vertices, also fixed ones
  double max_displacement_mm = 0;
};

// Smooths the mesh in place: an oriented manifold, or the walls between labels. Vertices on the
// boundary stay; those of a closed surface on the border of the volume, too. So caps stay flat, and
// closing a surface does not change the smoothing of its rest. Where means leave a triangle without
// area, its corners stay: components of a sample or two would shrink to a point. Of walls
// (separate.h), a vertex on a junction curve moves to the mean of its two neighbours along the
// curve, and the ends and junctions of curves stay. So two labels still share their walls; enclosed
// volumes of SmoothingEffect mean nothing then. The result does not depend on the number of
// threads. Throws Error kCancelled; the positions are indeterminate then.
SmoothingEffect smooth(const SmoothOptions& options, const Context& context, Mesh& mesh);

// An upper bound of the memory that `smooth` takes beside the mesh, in bytes, with the present
// number of threads. For means: some layers of positions for each thread and, for many steps, a
// copy of all positions. For moves along the surface: that copy, and the neighbours of all
// vertices.
std::uint64_t smoothing_memory(const SmoothOptions& options, const SurfaceSize& size);

}  // namespace isomesh::mesh
