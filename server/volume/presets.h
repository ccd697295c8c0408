// Iso-values that suit a kind of volume.
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "proto/types.h"

namespace isomesh::volume {

// The presets of a CT in Hounsfield units that lie within the range of the samples. Other
// modalities have none, nor has a CT whose rescale type (0028,1054) is another unit.
std::vector<Preset> presets_for(std::string_view modality, std::string_view rescale_type,
                                const std::array<double, 2>& range);

}  // namespace isomesh::volume
