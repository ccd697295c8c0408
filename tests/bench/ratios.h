// How isomesh stands to its peers and to the project's goals. What is compared is run in turn, pair
// by pair: see timing.h.
#pragma once

#include <vector>

#include "tests/bench/findings.h"

namespace isomesh::bench {

// Measures those whose sentences match the plan's filter, at the largest number of threads, and the
// cost of growth over the sizes of the synthetic field when there are three at least. Those that
// need peers are left out without them.
std::vector<Finding> measure_ratios(const Plan& plan);

}  // namespace isomesh::bench
