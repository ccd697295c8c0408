// The budget of CI: what stages may take of the processor's time, beside a plain loop of the same
// run on the same machine.
#pragma once

#include "tests/bench/rows.h"

namespace isomesh::bench {

// A row for each stage with its time, the loop's, their ratio, the ratio that was measured when the
// stage was last changed, and whether it is within twice that. Runs on one thread, takes seconds.
Json measure_budget();

}  // namespace isomesh::bench
