#include "server/jobs/library/defaults.h"

#include <algorithm>
#include <string>
#include <vector>

#include "base/text.h"
#include "proto/presets.h"
#include "server/mesh/smooth/methods.h"

namespace isomesh::jobs {

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

void check_has_cells(const Volume& volume) {
  if (std::ranges::min(volume.dims) < 2) {
    throw Error(ErrorCode::kUnusableVolume,
                "labels need a volume with at least two samples along each axis; this one is " +
                    std::to_string(volume.dims[0]) + " x " + std::to_string(volume.dims[1]) +
                    " x " + std::to_string(volume.dims[2]));
  }
}

void limit_displacement(const Volume& volume, MeshParameters& parameters) {
  const bool is_unbounded = mesh::method_of(parameters.smoothing).is_unbounded();
  if (is_unbounded && !parameters.max_displacement_mm) {
    parameters.max_displacement_mm = std::ranges::min(volume.geometry.spacing) / 2;
  }
}

}  // namespace isomesh::jobs
