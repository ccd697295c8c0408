// Smoothing by polynomials of the step to the neighbours' mean; private to this folder.
#pragma once

#include <span>
#include <vector>

#include "server/mesh/stairs/wall_shape.h"

namespace isomesh::mesh {

// Approximates a function of k, the eigenvalue of 1 - mean (0: constant, 2: the sign changes from
// each vertex to the next). Returns the coefficients c[j] of the Chebyshev polynomials T[j](1 - k)
// on [0, 2] (J. C. Mason, D. C. Handscomb, "Chebyshev Polynomials", 2003). Their sum is 1, so
// constants are preserved.
std::vector<float> diffusion_series(int degree, double time);  // exp(-time k)
std::vector<float> flat_series(int degree, double time);       // (1 + time k) exp(-time k)
// Moves those vertices, which are ascending, by the polynomial of the step that goes `shares[v]` of
// the way to the mean of a vertex's neighbours; all others stay. Throws Error kCancelled.
void filter(const std::vector<std::uint32_t>& vertices, const std::vector<float>& shares,
            std::span<const float> series, const Context& context, WallShape& shape);

}  // namespace isomesh::mesh
