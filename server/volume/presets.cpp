#include "server/volume/presets.h"

#include "proto/presets.h"

namespace isomesh::volume {
namespace {

struct Row {
  std::string_view name;
  double hounsfield;
};

// Air is -1000 and water 0. Skin is the border of air. Soft tissue is midway between fat (about
// -100) and muscle and organs (about 50), so fat is excluded. Bone begins above the usual values of
// contrast agent and calcified tissue.
constexpr Row kPresets[] = {{kSkinPreset, -300}, {kSoftTissuePreset, -25}, {kBonePreset, 250}};

}  // namespace

std::vector<Preset> presets_for(std::string_view modality, std::string_view rescale_type,
                                const std::array<double, 2>& range) {
  std::vector<Preset> presets;
  if (modality != "CT" || (!rescale_type.empty() && rescale_type != "HU")) return presets;
  for (const Row& row : kPresets) {
    if (row.hounsfield <= range[0] || row.hounsfield > range[1]) continue;
    presets.push_back({std::string(row.name), row.hounsfield});
  }
  return presets;
}

}  // namespace isomesh::volume
