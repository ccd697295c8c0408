// A synthetic segmentation, and the points that it is made from.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "tests/bench/samples.h"

namespace isomesh::bench {

inline constexpr std::size_t kBodyLabels = 104;

// A body of 104 labels, 1 to 104, on n^3 samples of 1.5 mm: ellipsoids and bent tubes that touch
// each other, on a background of 0 that reaches all around. Deterministic. n: at least 64, so that
// all labels are there.
Samples label_body(std::uint32_t n);

// The n-th of the points that fill the unit cube evenly (M. Roberts, "The unreasonable
// effectiveness of quasirandom sequences", 2018).
std::array<double, 3> even_point(std::size_t n);

}  // namespace isomesh::bench
