// The time of every stage, ours and the peers', and how time and memory grow.
#pragma once

#include "tests/bench/findings.h"
#include "tests/bench/rows.h"

namespace isomesh::bench {

// A row for each stage whose name matches the plan's filter, of each volume, lattice and number of
// threads.
Json measure_stages(const Plan& plan);

// The synthetic field of each size: times of the stages and of a whole job, and the peaks of their
// memory, each measured in a process of its own. At the plan's largest number of threads.
Json measure_growth(const Plan& plan);

}  // namespace isomesh::bench
