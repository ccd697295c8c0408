// Iso-values that suit a kind of volume.
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "proto/types.h"

namespace isomesh::volume {

// Those of a CT in Hounsfield units, as far as they lie within the range of the samples; none for
// other modalities, and for a CT whose rescale type (0028,1054) is told to be another unit.
std::vector<Preset> presets_for(std::string_view modality, std::string_view rescale_type,
                                const std::array<double, 2>& range);

}  // namespace isomesh::volume
