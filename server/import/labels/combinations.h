// Overlapping labels -> samples with a single value: the number of the sample's combination of
// labels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "proto/types.h"

namespace isomesh::import {

// Numbers the combinations of labels of samples. A single label keeps its number. Other
// combinations get free numbers above the highest label, in the order of the requests, until
// sort_values(). Not thread safe.
class Combinations {
 public:
  // A sample's labels so far. The default has none.
  using State = std::uint32_t;
  static constexpr State kNone = 0;

  // Labels are 1..highest_label, at most 65535.
  explicit Combinations(std::uint32_t highest_label);

  // Adds `label` to the labels of `state`. Add labels in ascending order. Throws Error
  // kUnusableVolume if there are too many combinations.
  State with(State state, std::uint32_t label);

  // Returns an unused label above all others. Throws as value() does.
  std::uint32_t new_label();

  // The value of samples of that state, at most 65535. Throws Error kUnusableVolume if there are
  // more combinations.
  std::uint32_t value(State state);

  // For each label with values beside its own: its requested values. Sets the entries' `values`,
  // and adds missing entries. Ascending.
  std::vector<LabelEntry> entries(std::vector<LabelEntry> named) const;

  // Writes the values of consecutive samples as `type`, uint8 or uint16. Returns false if one does
  // not fit.
  bool write(std::span<const State> states, SampleType type, std::span<std::byte> target);

  // Numbers the combinations anew, in the order of their labels. So their numbers do not depend on
  // the order in which samples were written. `samples` are all that were written, as `type`. Call
  // it before entries(); otherwise a file that is stored the other way is another volume.
  void sort_values(SampleType type, std::span<std::byte> samples);

  // A note on the number of written samples with several labels; empty if there are none.
  std::optional<Note> note() const;

 private:
  // A combination: its parent and one more label.
  struct Node {
    State parent = kNone;
    std::uint32_t label = 0;
    std::uint32_t size = 0;
    std::uint32_t value = 0;  // 0: not requested yet
  };

  std::uint32_t next_value();
  bool is_before(State one, State other) const;

  std::vector<Node> nodes_ = {{}};
  std::unordered_map<std::uint64_t, State> children_;  // by parent and label
  std::uint32_t next_value_;
  std::size_t overlaps_ = 0;
  std::uint64_t overlapping_samples_ = 0;
  // Caches the last call of with(): equal samples are often adjacent.
  std::uint64_t last_key_ = 0;
  State last_state_ = kNone;
};

}  // namespace isomesh::import
