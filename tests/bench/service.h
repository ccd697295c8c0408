// Measures a daemon of the benchmark's own over HTTP, and the peers in this process.
#pragma once

#include <filesystem>
#include <vector>

#include "tests/bench/findings.h"

namespace isomesh::bench {

struct ServicePlan {
  std::filesystem::path daemon;  // isomeshd
  std::filesystem::path volume;  // a file that it imports
  double iso = 0;
  int threads = 0;  // of the daemon's kernels and the peers; 0: one a processor
};

// Starts the daemon on a free port with a data folder of its own, and ends it. The daemon is warm:
// every kind of job has run once before it is timed, and none is answered with another's mesh.
// Throws std::runtime_error when the daemon does not start, and what the client library throws.
std::vector<Finding> measure_service(const ServicePlan& plan);

}  // namespace isomesh::bench
