// The methods of smoothing as data: the steps of a pass, what holds vertices, and what a pass
// costs. A new method is a row in methods.cpp, and its name in proto/smoothing.h.
#pragma once

#include <span>
#include <vector>

#include "proto/smoothing.h"

namespace isomesh::mesh {

// How a step moves vertices. Vertices on the boundary, and on the caps of a closed surface, stay.
enum class Move {
  kMean,            // to the mean of the neighbours (layer_steps.h)
  kTangentialMean,  // the same, but along the extracted surface (quality.h)
  kBisectors,       // along it, to where spokes halve the neighbours' angles
  kLargestAngle,    // along it, to where the smallest angle is largest
  kRemoveStairs,    // all that stairs/stairs.h does; not by smooth()
};

struct Step {
  Move move = Move::kMean;
  double weight = 1;  // of a mean: the share of the way to it; negative: away from it

  bool operator==(const Step&) const = default;
};

// Vertices on junction curves, where several walls meet.
enum class AtCurves {
  kAlong,  // a mean moves them along their curve; other moves leave them where they are
  kStay
};

// The parameters of weights.
struct Relaxation {
  double lambda = 1;
  double pass_band = 0;
};

struct PassStep {
  enum class Passes { kAll, kFirstHalf, kSecondHalf };

  Move move;
  double (*weight)(const Relaxation& relaxation);
  Passes passes = Passes::kAll;
};

struct SmoothingMethod {
  Smoothing smoothing;
  std::span<const PassStep> pass;
  AtCurves at_curves = AtCurves::kAlong;
  // Milliseconds on one thread, for estimates.
  double ms_per_triangle;
  double ms_per_triangle_and_pass;

  // True if its steps lead from the extracted surface, and nothing but `max_displacement_mm` says
  // how far.
  bool is_unbounded() const;
  bool removes_stairs() const { return pass.front().move == Move::kRemoveStairs; }
  // The steps of all passes, in order.
  std::vector<Step> steps(int passes, const Relaxation& relaxation) const;
};

const SmoothingMethod& method_of(Smoothing smoothing);

// The weight of Taubin's second step after a first one of `lambda`: what varies more slowly along
// the surface than `pass_band` is kept, what varies faster is smoothed away. 1/lambda + 1/mu =
// pass_band, as in his paper. For 0 < pass_band < 1/lambda.
double taubin_mu(double lambda, double pass_band);

}  // namespace isomesh::mesh
