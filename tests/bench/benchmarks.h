// Every stage, ours and the peers', under Google Benchmark.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tests/bench/samples.h"

namespace isomesh::bench {

// Configuration of one run of isomesh-bench.
struct Plan {
  std::optional<Samples> volume;           // the real one
  double iso = 0;                          // its iso-value
  std::vector<std::uint32_t> field_sizes;  // of the synthetic field
  std::vector<int> threads;                // ascending
  std::string filter = ".";                // a regular expression on the names; "." is all
  bool json = false;
};

// Runs the benchmarks whose names match. Prints medians to standard output or, if the plan is for
// JSON, returns Google Benchmark's document; empty if no name matches. Sets the threads of the
// stages and of the peers.
std::string run_benchmarks(const Plan& plan);

}  // namespace isomesh::bench
