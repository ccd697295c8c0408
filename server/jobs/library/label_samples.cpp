#include "server/jobs/library/label_samples.h"

#include <algorithm>
#include <iterator>
#include <set>
#include <utility>
#include <vector>

#include "proto/error.h"

namespace isomesh::jobs {
namespace {

using NumberSet = std::set<std::int64_t>;

NumberSet numbers_in(const LabelValues& lists) {
  NumberSet all;
  for (const auto& [label, values] : lists) all.insert(values.begin(), values.end());
  return all;
}

// True for the lists of a job that an older version accepted and completed: those of samples. They
// have a label's own samples, and among these a number that no label has. In lists of labels, such
// a number would add nothing.
bool are_of_samples(const LabelValues& lists, const LabelValues& table, const NumberSet& numbers) {
  return std::ranges::any_of(lists, [&](const auto& list) {
    const auto own = table.find(list.first);
    return own != table.end() &&
           NumberSet(list.second.begin(), list.second.end()) ==
               NumberSet(own->second.begin(), own->second.end()) &&
           std::ranges::any_of(list.second, [&](std::int64_t each) {
             return numbers.contains(each) && !table.contains(each);
           });
  });
}

}  // namespace

LabelValues values_of(const Volume& volume) {
  LabelValues values;
  for (const LabelEntry& entry : volume.labels) {
    if (!entry.values.empty()) values[entry.label] = entry.values;
  }
  return values;
}

LabelValues label_samples(const LabelValues& lists, const Volume& volume) {
  const LabelValues table = values_of(volume);
  if (table.empty()) return lists;
  const NumberSet numbers = numbers_in(table);
  const bool has_samples = are_of_samples(lists, table, numbers);
  const NumberSet joined = has_samples ? NumberSet() : numbers_in(lists);
  LabelValues result;
  for (const auto& [label, labels] : lists) {
    NumberSet own;
    for (const std::int64_t each : labels) {
      const auto known = table.find(each);
      if (has_samples || (known == table.end() && !numbers.contains(each))) {
        own.insert(each);
      } else if (known != table.end()) {
        own.insert(known->second.begin(), known->second.end());
      }
    }
    result[label].assign(own.begin(), own.end());
  }
  for (const auto& [label, values] : table) {
    if (!joined.contains(label)) result.try_emplace(label, values);
  }
  const NumberSet taken = numbers_in(result);
  std::vector<std::int64_t> rest;
  std::ranges::set_difference(numbers, taken, std::back_inserter(rest));
  if (!rest.empty()) result[0] = std::move(rest);
  return result;
}

MeshParameters with_label_samples(MeshParameters parameters, const Volume& volume) {
  if (!parameters.labels) return parameters;
  parameters.label_values = label_samples(parameters.label_values, volume);
  // With all labels, the values of one are no labels of their own. Of chosen labels, only their own
  // values matter.
  if (!parameters.labels->is_all()) {
    std::erase_if(parameters.label_values, [&](const auto& entry) {
      return !std::ranges::binary_search(parameters.labels->values, entry.first);
    });
  }
  return parameters;
}

void check_background(const Volume& volume, std::int64_t background) {
  if (background == 0 || values_of(volume).empty()) return;
  throw invalid_parameter(
      "background",
      "must be 0, because the samples of this volume have other numbers than its labels: they "
      "overlap, or have 64 bits");
}

}  // namespace isomesh::jobs
