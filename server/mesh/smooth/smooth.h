// Smoothing of a surface mesh: Laplacian (D. A. Field, "Laplacian smoothing and Delaunay
// triangulations", Communications in Applied Numerical Methods 4(6), 1988) and Taubin's (G. Taubin,
// "A signal processing approach to fair surface design", SIGGRAPH 1995).
//
// A step moves every free vertex by a share of the way to the mean of its neighbours, all from the
// positions that the step before left. A triangle of layer k names only vertices of layers k and
// k + 1, so a step needs of the step before no more than the layers next to the one that it moves:
// several steps go through the layers together, each one layer behind the one before it, and only
// what is between the first and the last is held beside the mesh.
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

namespace isomesh::mesh {

// The points p with normal . p <= offset, in millimetres; the normal has length 1.
struct HalfSpace {
  std::array<double, 3> normal = {0, 0, 0};
  double offset = 0;
};

// How a vertex is moved: towards the mean of its neighbours, or in the surface so that angles grow
// (quality.h). Only the first looks at lambda, mu and within.
enum class SmoothingWay { kMean, kAngle, kOptimize };

struct SmoothOptions {
  int passes = 5;
  double lambda = 1;  // (0, 1]: the share of the way to the mean of the neighbours
  // Of a second step in every pass, away from the mean: negative, see taubin_mu. 0: no second step.
  double mu = 0;
  // No vertex is ever farther than this from where it was extracted. Millimetres, 0 or more.
  double max_displacement_mm = std::numeric_limits<double>::infinity();
  // No free vertex leaves them. Steps away from the mean would, next to caps: their side of them.
  std::vector<HalfSpace> within = {};
  SmoothingWay way = SmoothingWay::kMean;
};

// The second step's share for a first step of `lambda` and a pass-band frequency: what varies more
// slowly along the surface than `pass_band` is kept, what varies faster is smoothed away. 1/lambda
// + 1/mu = pass_band, as in Taubin's paper. For 0 < pass_band < 1/lambda.
double taubin_mu(double lambda, double pass_band);

// The box of a lattice's samples, wider by that share of a step on each side.
std::vector<HalfSpace> box_around(const LatticeToSpace& to_space, const Dims& dims, double wider);

// What smoothing did to a surface.
struct SmoothingEffect {
  Extent before;
  Extent after;
  double mean_displacement_mm = 0;  // of all vertices, fixed ones too
  double max_displacement_mm = 0;
};

// Smooths the mesh, an oriented manifold or the walls between labels, in place. A vertex on the
// boundary stays where it is and, of a closed surface, one on the border of the volume: caps stay
// flat, and closing a surface does not change how the rest of it is smoothed. Of the walls between
// labels (separate.h) a vertex on a line where three of them meet goes to the mean of its two
// neighbours along that line, and one where lines meet or end stays; so walls stay what two labels
// share. Enclosed volumes of SmoothingEffect mean nothing then. The result is the same to the byte
// for any number of threads. Throws Error kCancelled; the positions are indeterminate then.
SmoothingEffect smooth(const SmoothOptions& options, const Context& context, Mesh& mesh);

// An upper bound of what `smooth` takes beside the mesh, in bytes, on the present number of
// threads: some layers' positions for each thread, or, where there are too many steps for that,
// those and one copy of all positions. To raise angles: that copy, and the neighbours of all
// vertices.
std::uint64_t smoothing_memory(const SmoothOptions& options, const SurfaceSize& size);

}  // namespace isomesh::mesh
