// The labels that a sample belongs to.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <span>
#include <utility>
#include <vector>

namespace isomesh::mesh {

// A part is all samples that belong to the same labels; walls separate parts. Parts are numbered
// from 1 on; 0 is what belongs to no label, the background. Where every label is the samples of one
// value of its own, its part's number is its place among the labels, from 1 on.
using PartNumber = std::uint16_t;

// Immutable, so safe to read from several threads.
class LabelParts {
 public:
  LabelParts() = default;

  // `labels`: ascending, each once. `values`: of those labels that are not the samples of their own
  // value, all values whose samples belong to them. Throws Error kUnusableVolume when there are
  // more parts than kMostLabels (separate.h).
  LabelParts(std::span<const std::int64_t> labels,
             const std::map<std::int64_t, std::vector<std::int64_t>>& values);

  // Every value that belongs to a label, with its part; ascending.
  std::span<const std::pair<std::int64_t, PartNumber>> values() const { return values_; }

  std::size_t labels() const { return labels_; }

  // True if a part belongs to several labels, or a label has several parts.
  bool overlap() const { return !members_.empty(); }

  // Calls visit(number of the label, whether `front` belongs to it) for each label that one of the
  // two parts belongs to and the other does not: those between which a wall is. From 1 on.
  template <class Visit>
  void visit_labels(PartNumber front, PartNumber back, Visit visit) const {
    if (members_.empty()) {  // a part is a label
      if (front != 0) visit(std::size_t{front}, true);
      if (back != 0) visit(std::size_t{back}, false);
      return;
    }
    for (const PartNumber label : members_[front]) {
      if (!belongs(back, label)) visit(std::size_t{label}, true);
    }
    for (const PartNumber label : members_[back]) {
      if (!belongs(front, label)) visit(std::size_t{label}, false);
    }
  }

  // True if the part belongs to label number `label`.
  bool belongs(PartNumber part, std::size_t label) const {
    if (members_.empty()) return part == label;
    return std::ranges::binary_search(members_[part], label);
  }

  bool operator==(const LabelParts&) const = default;

 private:
  std::vector<std::pair<std::int64_t, PartNumber>> values_;
  std::size_t labels_ = 0;
  // Numbers of the labels of each part, ascending. Empty where every part is one label.
  std::vector<std::vector<PartNumber>> members_;
};

}  // namespace isomesh::mesh
