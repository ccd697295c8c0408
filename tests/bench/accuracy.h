// Measures the accuracy and cost of simplification, compared with other tools at equal triangle
// counts. Also measures the time of certification.
#pragma once

#include <vector>

#include "tests/bench/rows.h"
#include "tests/bench/samples.h"

namespace isomesh::bench {

// Parameters of the accuracy measurements.
struct AccuracyPlan {
  double iso = 0;
  int passes = 5;
  int threads = 1;
  std::vector<double> errors_mm = {0.02, 0.05, 0.1, 0.2, 0.5};
  bool with_peers = true;  // the slow ones, where they were found
};

// A job that bounds nothing, the same with a certificate, then for each error a job with that
// bound, and behind it others that make as many triangles of the smoothed surface. Distances are
// in millimetres: from the mesh to the surface as it was extracted ("to_scan") and the other way.
// Each is run once: to be repeated by whoever wants to know how steady times are.
Json measure_approximations(const Samples& samples, const AccuracyPlan& plan);

// The smoothed surface against the extracted one and the other way round: milliseconds of both
// ways together, the median of some runs, and what they find.
Json measure_certify(const Samples& samples, const AccuracyPlan& plan);

// A job by the labels of 20^3 random samples, with a certificate, at some spacings: the same
// triangles, but many times as long in one direction. `expected_ms`: by stage_times.h.
Json measure_uneven(int threads);

}  // namespace isomesh::bench
