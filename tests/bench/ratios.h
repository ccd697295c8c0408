// How isomesh stands to its peers and to the project's goals. What is compared is run in turn, pair
// by pair: see timing.h.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tests/bench/benchmarks.h"
#include "tests/bench/rows.h"

namespace isomesh::bench {

struct Goal {
  double value = 0;
  bool at_most = true;  // otherwise at least
};

struct Finding {
  std::string name;  // "ratio/...", for the filter
  std::string what;  // a sentence for the table
  std::string ours;  // with the unit
  std::string peer;  // empty without a peer
  double value = 0;  // what the goal is about
  std::optional<Goal> goal;

  bool reached() const;  // true without a goal
};

// Measures those whose names match the plan's filter, at the largest number of threads, and the
// cost of growth over the sizes of the synthetic field when there are three at least. Those that
// need peers are left out without them.
std::vector<Finding> measure_findings(const Plan& plan);

// As text for a terminal.
std::string to_table(const std::vector<Finding>& findings);

// An object for each, with the members name, what, isomesh and value, and peer, goal_at_most or
// goal_at_least and reached where there is a peer or a goal.
Json to_json(const std::vector<Finding>& findings);

}  // namespace isomesh::bench
