#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "proto/types.h"

namespace isomesh::volume {

// The presets of a CT in Hounsfield units that are within the range of the samples. Empty for other
// modalities, and for a CT with another rescale type (0028,1054).
std::vector<Preset> presets_for(std::string_view modality, std::string_view rescale_type,
                                const std::array<double, 2>& range);

}  // namespace isomesh::volume
