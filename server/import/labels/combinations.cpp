#include "server/import/labels/combinations.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <numeric>
#include <string>
#include <type_traits>

#include "proto/samples.h"
#include "server/import/labels/label_table.h"
#include "server/import/source/names.h"

namespace isomesh::import {
namespace {

// Some of them may occur in no sample in the end.
constexpr std::size_t kMostStates = std::size_t{1} << 20;

template <class Value>
bool write_as(std::span<const std::uint32_t> values, std::span<std::byte> target) {
  for (std::size_t at = 0; at < values.size(); ++at) {
    const auto value = static_cast<Value>(values[at]);
    if (value != values[at]) return false;
    std::memcpy(target.data() + at * sizeof(Value), &value, sizeof(Value));
  }
  return true;
}

}  // namespace

Combinations::Combinations(std::uint32_t highest_label) : next_value_(highest_label + 1) {}

Combinations::State Combinations::with(State state, std::uint32_t label) {
  if (nodes_[state].label == label) return state;
  const std::uint64_t key = std::uint64_t{state} << 32 | label;
  if (key == last_key_ && last_state_ != kNone) return last_state_;
  const auto [child, is_new] = children_.emplace(key, static_cast<State>(nodes_.size()));
  if (is_new) {
    if (nodes_.size() == kMostStates) {
      throw_unusable("The segments overlap in more than " + std::to_string(kMostStates) +
                     " combinations. Choose one segment with volume=N, or send fewer masks.");
    }
    nodes_.push_back({.parent = state, .label = label, .size = nodes_[state].size + 1});
  }
  last_key_ = key;
  last_state_ = child->second;
  return last_state_;
}

std::uint32_t Combinations::new_label() { return next_value(); }

std::uint32_t Combinations::next_value() {
  constexpr std::uint32_t kMostValues = 0xFFFF;
  if (next_value_ > kMostValues) {
    throw_unusable("The segments and their overlaps need more than the " +
                   std::to_string(kMostValues) +
                   " values that are available. Choose one segment with volume=N, or send fewer "
                   "masks.");
  }
  return next_value_++;
}

std::uint32_t Combinations::value(State state) {
  Node& node = nodes_[state];
  if (node.value == 0 && node.size == 1) node.value = node.label;
  if (node.value == 0 && node.size > 1) {
    node.value = next_value();
    ++overlaps_;
  }
  return node.value;
}

std::vector<LabelEntry> Combinations::entries(std::vector<LabelEntry> named) const {
  std::map<std::uint32_t, std::vector<std::int64_t>> values;
  std::size_t count = 0;
  for (const Node& node : nodes_) {
    if (node.value == 0) continue;
    count += node.size;
    // Each takes a few bytes of a response, and one combination may have thousands of labels.
    if (count > Volume::kMostLabels * 16) {
      throw_unusable(
          "The segments overlap in too many combinations to list. Choose one segment with "
          "volume=N, or send fewer masks.");
    }
    for (const Node* part = &node; part->size > 0; part = &nodes_[part->parent]) {
      values[part->label].push_back(node.value);
    }
  }
  for (const auto& [label, unused] : values) named.push_back({.label = label});
  named = label_table(std::move(named));
  for (LabelEntry& entry : named) {
    const auto found = values.find(static_cast<std::uint32_t>(entry.label));
    if (found == values.end()) continue;
    std::ranges::sort(found->second);
    if (found->second != std::vector{entry.label}) entry.values = std::move(found->second);
  }
  return label_table(std::move(named));
}

bool Combinations::write(std::span<const State> states, SampleType type,
                         std::span<std::byte> target) {
  std::vector<std::uint32_t> values(states.size());
  for (std::size_t at = 0; at < states.size(); ++at) {
    values[at] = value(states[at]);
    if (nodes_[states[at]].size > 1) ++overlapping_samples_;
  }
  return type == SampleType::kUint8 ? write_as<std::uint8_t>(values, target)
                                    : write_as<std::uint16_t>(values, target);
}

// By the highest labels first. Each set of labels has one state.
bool Combinations::is_before(State one, State other) const {
  while (one != other) {
    const std::uint32_t label = nodes_[one].label;
    const std::uint32_t its = nodes_[other].label;
    if (label != its) return label < its;
    one = nodes_[one].parent;
    other = nodes_[other].parent;
  }
  return false;
}

void Combinations::sort_values(SampleType type, std::span<std::byte> samples) {
  std::vector<State> states;
  std::vector<std::uint32_t> values;
  for (State state = 0; state < nodes_.size(); ++state) {
    if (nodes_[state].size < 2 || nodes_[state].value == 0) continue;
    states.push_back(state);
    values.push_back(nodes_[state].value);
  }
  std::ranges::sort(states, [&](State one, State other) { return is_before(one, other); });
  std::ranges::sort(values);
  std::vector<std::uint32_t> new_values(next_value_);
  std::iota(new_values.begin(), new_values.end(), 0);
  bool is_any = false;
  for (std::size_t at = 0; at < states.size(); ++at) {
    std::uint32_t& value = nodes_[states[at]].value;
    is_any = is_any || value != values[at];
    new_values[value] = values[at];
    value = values[at];
  }
  if (!is_any) return;
  with_sample(type, [&](auto sample) {
    using Sample = decltype(sample);
    if constexpr (std::is_unsigned_v<Sample>) {
      auto* const first = reinterpret_cast<Sample*>(samples.data());
      std::transform(first, first + samples.size() / sizeof(Sample), first,
                     [&](Sample value) { return static_cast<Sample>(new_values[value]); });
    }
  });
}

std::optional<Note> Combinations::note() const {
  if (overlapping_samples_ == 0) return std::nullopt;
  return note_of(NoteCode::kOverlappingSegments,
                 std::to_string(overlapping_samples_) +
                     (overlapping_samples_ == 1 ? " sample belongs" : " samples belong") +
                     " to several segments. " + std::to_string(overlaps_) +
                     (overlaps_ == 1 ? " value stands" : " values stand") +
                     " for their combinations.");
}

}  // namespace isomesh::import
