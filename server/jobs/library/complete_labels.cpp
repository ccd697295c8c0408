#include "server/jobs/library/complete_labels.h"

#include <algorithm>
#include <string>

#include "base/text.h"
#include "proto/presets.h"
#include "server/mesh/labels/label_voxels.h"
#include "server/mesh/smooth/methods.h"
#include "server/volume/names.h"

namespace isomesh::jobs {
namespace {

template <class T>
void keep_chosen(const std::vector<std::int64_t>& chosen, std::map<std::int64_t, T>& texts) {
  std::erase_if(
      texts, [&](const auto& entry) { return !std::ranges::binary_search(chosen, entry.first); });
}

}  // namespace

void resolve_preset(MeshParameters& parameters, const Volume& volume) {
  if (parameters.preset.empty()) return;
  std::vector<std::string> names;
  for (const Preset& preset : volume.presets) {
    names.push_back(in_quotes(name_in_requests(preset.name)));
    if (name_in_requests(preset.name) == parameters.preset) parameters.iso = preset.iso;
  }
  if (!parameters.iso) {
    throw invalid_parameter(
        rows::kIso.name,
        "the volume has no preset " + in_quotes(parameters.preset) + "; it has " +
            (names.empty() ? "none. Only CTs in Hounsfield units and fractional segmentations have "
                             "presets, and only for values that occur in them. For a CT whose file "
                             "does not say so, upload it with modality=ct"
                           : listed(names)));
  }
  parameters.preset.clear();
}

JobParameters complete_labels(JobParameters parameters, const store::Viewer& viewer,
                              const Volume& volume, LabelLists& lists) {
  if (std::ranges::min(volume.dims) < 2) {
    throw Error(ErrorCode::kUnusableVolume,
                "labels need a volume with at least two samples along each axis; this one is " +
                    std::to_string(volume.dims[0]) + " x " + std::to_string(volume.dims[1]) +
                    " x " + std::to_string(volume.dims[2]));
  }
  check_background(volume, parameters.background);
  for (const auto& [label, values] : values_of(volume)) {
    parameters.label_values.try_emplace(label, values);
  }
  for (auto& [label, name] : parameters.label_names) name = volume::normalized(name);
  const auto counts = lists.counts(viewer, volume);
  const auto chosen = mesh::chosen_labels(*counts, parameters);
  std::vector<std::int64_t> labels;
  std::ranges::transform(chosen, std::back_inserter(labels), &mesh::LabelVoxels::label);
  for (const LabelEntry& entry : volume.labels) {
    if (!entry.name.empty()) parameters.label_names.try_emplace(entry.label, entry.name);
    if (entry.color) parameters.label_colors.try_emplace(entry.label, *entry.color);
  }
  keep_chosen(labels, parameters.label_names);
  keep_chosen(labels, parameters.label_colors);
  // With all labels, a value assigned to one label is no label of its own. With chosen labels, only
  // their own values matter.
  if (!parameters.labels->is_all()) keep_chosen(labels, parameters.label_values);
  const bool is_unbounded = mesh::method_of(parameters.smoothing).is_unbounded();
  if (is_unbounded && !parameters.max_displacement_mm) {
    parameters.max_displacement_mm = std::ranges::min(volume.geometry.spacing) / 2;
  }
  return parameters;
}

}  // namespace isomesh::jobs
