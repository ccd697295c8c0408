#include "server/mesh/labels/label_parts.h"

#include <string>

#include "proto/error.h"
#include "server/mesh/labels/separate.h"

namespace isomesh::mesh {

LabelParts::LabelParts(std::span<const std::int64_t> labels,
                       const std::map<std::int64_t, std::vector<std::int64_t>>& values)
    : labels_(labels.size()) {
  std::map<std::int64_t, std::vector<PartNumber>> labels_of;  // of each value, ascending
  bool is_one_value_a_label = true;
  for (std::size_t n = 0; n < labels.size(); ++n) {
    const auto number = static_cast<PartNumber>(n + 1);
    const auto given = values.find(labels[n]);
    if (given == values.end()) {
      labels_of[labels[n]].push_back(number);
      continue;
    }
    is_one_value_a_label = false;
    for (const std::int64_t value : given->second) labels_of[value].push_back(number);
  }
  if (is_one_value_a_label) {
    for (const auto& [value, numbers] : labels_of) values_.emplace_back(value, numbers.front());
    return;
  }
  std::map<std::vector<PartNumber>, PartNumber> parts;
  members_.emplace_back();  // the background's
  for (const auto& [value, numbers] : labels_of) {
    const auto [part, is_new] =
        parts.try_emplace(numbers, static_cast<PartNumber>(members_.size()));
    if (is_new) {
      if (members_.size() > kMostLabels) {
        throw Error(
            ErrorCode::kUnusableVolume,
            "the labels overlap in more than " + std::to_string(kMostLabels) + " different ways");
      }
      members_.push_back(numbers);
    }
    values_.emplace_back(value, part->second);
  }
}

}  // namespace isomesh::mesh
