// What is compared with a peer or with one of the project's goals.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tests/bench/rows.h"
#include "tests/bench/samples.h"
#include "tests/bench/timing.h"

namespace isomesh::bench {

struct Goal {
  double value = 0;
  bool at_most = true;  // otherwise at least
};

struct Finding {
  std::string what;  // a sentence for the table
  std::string ours;  // with the unit
  std::string peer;  // empty without a peer
  double value = 0;  // what the goal is about
  std::optional<Goal> goal;
};

// Both times and their ratio.
Finding compared(const std::string& what, const Paired& times, std::optional<Goal> goal);
// A time without a peer; the value is in milliseconds.
Finding timed(const std::string& what, double ms, std::optional<Goal> goal = {});

// An object for each.
Json to_json(const std::vector<Finding>& findings);

// Configuration of one run of isomesh-bench.
struct Plan {
  std::optional<Samples> volume;           // the real one
  double iso = 0;                          // its iso-value
  std::vector<std::uint32_t> field_sizes;  // of the synthetic field, ascending
  std::vector<int> threads;                // ascending
  std::string filter = ".";                // a regular expression on the names; "." is all
};

}  // namespace isomesh::bench
