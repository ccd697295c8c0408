#include "tests/bench/report_text.h"

#include <algorithm>
#include <iostream>

#include "tests/bench/numbers.h"

namespace isomesh::bench {

std::string percent(double share) { return fixed(share * 100, 1) + " %"; }

std::string scheme_name(Scheme scheme) {
  return scheme == Scheme::kFive ? "5 tetrahedra" : "6 tetrahedra";
}

std::string title_of(const Samples& samples, const Subject::Level& level) {
  return samples.name + " " + std::to_string(samples.dims.x) + "x" +
         std::to_string(samples.dims.y) + "x" + std::to_string(samples.dims.z) + ", " + level.name;
}

std::string peer_time(double ms) { return ms > 0 ? milliseconds(ms) : "-"; }

void Factors::include(double factor) {
  low_ = empty_ ? factor : std::min(low_, factor);
  high_ = empty_ ? factor : std::max(high_, factor);
  empty_ = false;
}

std::string Factors::text(int digits) const {
  const std::string low = fixed(low_, digits);
  const std::string high = fixed(high_, digits);
  return low == high ? low : low + " to " + high;
}

void write_table(const std::vector<Finding>& findings, Document& document) {
  std::vector<std::vector<std::string>> rows;
  for (const Finding& finding : findings) {
    rows.push_back(
        {finding.what, finding.ours, finding.peer, fixed(finding.value, finding.value < 10 ? 2 : 0),
         finding.goal
             ? (finding.goal->at_most ? "at most " : "at least ") + fixed(finding.goal->value, 2)
             : "",
         !finding.goal       ? ""
         : finding.reached() ? "reached"
                             : "not reached"});
  }
  document.table({"what", "isomesh", "peer", "value", "goal", ""}, rows);
}

void say(const std::string& what) { std::cerr << "isomesh-bench: " << what << std::endl; }

}  // namespace isomesh::bench
