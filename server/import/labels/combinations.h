// Labels that overlap -> samples that have one value each: the number of the combination of labels
// that the sample has.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "proto/types.h"

namespace isomesh::import {

// The combinations of labels that samples have. A label that is alone keeps its number, and other
// combinations get the free ones above the highest label, in the order in which they are asked for.
// Not thread safe.
class Combinations {
 public:
  // What a sample has so far. A default one has no label.
  using State = std::uint32_t;
  static constexpr State kNone = 0;

  // Labels are 1..highest_label, which is 65535 at most.
  explicit Combinations(std::uint32_t highest_label);

  // What a sample of `state` has that is of `label`, too. Its labels come in ascending order.
  // Throws Error kUnusableVolume when there are too many combinations.
  State with(State state, std::uint32_t label);

  // A label above the others that nothing else has. Throws as value() does.
  std::uint32_t new_label();

  // The value of samples of that state, at most 65535. Throws Error kUnusableVolume when there are
  // more combinations than that.
  std::uint32_t value(State state);

  // The values that have been asked for of each label of which another value than its own has; the
  // entries' `values` are set, those without an entry get one. Ascending.
  std::vector<LabelEntry> entries(std::vector<LabelEntry> named) const;

  // Writes the values of a run of samples as `type`, uint8 or uint16. False when one does not fit.
  bool write(std::span<const State> states, SampleType type, std::span<std::byte> target);

  // How many of the samples that were written are of several labels; empty where none is.
  std::optional<Note> note() const;

 private:
  // One label more than another combination.
  struct Node {
    State parent = kNone;
    std::uint32_t label = 0;
    std::uint32_t size = 0;   // how many labels
    std::uint32_t value = 0;  // 0: not asked for yet
  };

  std::uint32_t next_value();

  std::vector<Node> nodes_ = {{}};
  std::unordered_map<std::uint64_t, State> children_;  // by parent and label
  std::uint32_t next_value_;
  std::size_t overlaps_ = 0;
  std::uint64_t overlapping_samples_ = 0;
  // Of the last call of with(): samples come in runs.
  std::uint64_t last_key_ = 0;
  State last_state_ = kNone;
};

}  // namespace isomesh::import
