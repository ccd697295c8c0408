// All labels of a segmentation, beside one run a label as others have it.
#pragma once

#include <cstdint>
#include <vector>

#include "tests/bench/ratios.h"
#include "tests/bench/samples.h"

namespace isomesh::bench {

inline constexpr std::size_t kBodyLabels = 104;

// A body of 104 labels, 1 to 104, on n^3 samples of 1.5 mm: ellipsoids and bent tubes that touch
// each other, on a background of 0. Deterministic. n: at least 64, so that all labels are there.
Samples label_body(std::uint32_t n);

// Extraction of all labels, with and without smoothing, over what the peers take for them, to
// vertices and triangles in memory; and what each label's measures take. Without peers ours alone.
std::vector<Finding> measure_label_findings(std::uint32_t n, int threads);

}  // namespace isomesh::bench
