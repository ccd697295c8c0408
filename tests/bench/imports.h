// The time of an import, by the order in which a file has its axes.
#pragma once

#include "tests/bench/rows.h"

namespace isomesh::bench {

// A row for each order of axes: NIfTI files of a synthetic scan, of one and of two bytes a sample,
// plain and gzipped. Each is timed in pairs with a file of the same bytes whose axes are said to be
// those of the patient, so that nothing is put in order.
Json measure_imports();

}  // namespace isomesh::bench
