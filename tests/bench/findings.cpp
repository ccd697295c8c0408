#include "tests/bench/findings.h"

namespace isomesh::bench {

Finding compared(const std::string& what, const Paired& times, std::optional<Goal> goal) {
  return {what, milliseconds(times.ours_ms), milliseconds(times.peer_ms), times.ratio, goal};
}

Finding timed(const std::string& what, double ms, std::optional<Goal> goal) {
  return {what + ", ms", milliseconds(ms), "", ms, goal};
}

Json to_json(const std::vector<Finding>& findings) {
  Json rows = Json::array();
  for (const auto& [what, ours, peer, value, goal] : findings) {
    Json row = {
        {"what", what}, {"isomesh", ours}, {"peer", peer}, {"value", value}, {"goal", Json()}};
    row["reached"] = Json();
    if (goal) {
      row["goal"] = (goal->at_most ? "at most " : "at least ") + fixed(goal->value, 2);
      row["reached"] = goal->at_most ? value <= goal->value : value >= goal->value;
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace isomesh::bench
