// The lattices and the smoothings that the paper names, beside each other.
#pragma once

#include "tests/bench/rows.h"
#include "tests/bench/samples.h"

namespace isomesh::bench {

// A ball with a radius of 27 samples in a cube of 64, as float32: the distance from its surface.
Samples ball();
inline constexpr double kBallIso = 0;

// Each scheme, plain and regularised, and each smoothing of it: how many triangles there are, how
// large their smallest angles are, what smoothing costs in volume, distance and time. Surfaces are
// closed where they meet the volume's border.
Json measure_lattices(const Samples& samples, double iso);

}  // namespace isomesh::bench
