// The time of an import, by the order in which a file has its axes.
#pragma once

#include "tests/bench/rows.h"

namespace isomesh::bench {

// A row for each order of axes: NIfTI files of one synthetic scan (int16), plain and gzipped. Each
// is timed in pairs with the file whose order is that of the patient.
Json measure_imports();

}  // namespace isomesh::bench
