#include "server/jobs/library/complete_labels.h"

#include <algorithm>
#include <string>

#include "server/jobs/library/label_samples.h"
#include "server/mesh/labels/label_voxels.h"
#include "server/volume/names.h"

namespace isomesh::jobs {
namespace {

template <class T>
void keep_chosen(const std::vector<std::int64_t>& chosen, std::map<std::int64_t, T>& texts) {
  std::erase_if(
      texts, [&](const auto& entry) { return !std::ranges::binary_search(chosen, entry.first); });
}

}  // namespace

JobParameters complete_labels(JobParameters parameters, const store::Viewer& viewer,
                              const Volume& volume, LabelLists& lists) {
  check_has_cells(volume);
  check_background(volume, parameters.background);
  for (auto& [label, name] : parameters.label_names) name = volume::normalized(name);
  const auto counts = lists.counts(viewer, volume);
  MeshParameters of_samples = parameters;
  of_samples.label_values = label_samples(parameters.label_values, volume);
  const auto chosen = mesh::chosen_labels(*counts, of_samples);
  std::vector<std::int64_t> labels;
  std::ranges::transform(chosen, std::back_inserter(labels), &mesh::LabelVoxels::label);
  for (const LabelEntry& entry : volume.labels) {
    if (!entry.name.empty()) parameters.label_names.try_emplace(entry.label, entry.name);
    if (entry.color) parameters.label_colors.try_emplace(entry.label, *entry.color);
  }
  keep_chosen(labels, parameters.label_names);
  keep_chosen(labels, parameters.label_colors);
  // With all labels, a label that another one joins is no label of its own. With chosen labels,
  // only their own lists matter.
  if (!parameters.labels->is_all()) keep_chosen(labels, parameters.label_values);
  limit_displacement(volume, parameters);
  return parameters;
}

}  // namespace isomesh::jobs
