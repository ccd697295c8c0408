// Names of iso-value presets: the server finds their values, the command takes their names.
#pragma once

#include <array>
#include <string_view>

namespace isomesh {

inline constexpr std::string_view kSkinPreset = "skin";
inline constexpr std::string_view kSoftTissuePreset = "soft tissue";
inline constexpr std::string_view kBonePreset = "bone";
inline constexpr std::string_view kSegmentPreset = "segment";  // of a fractional segmentation

inline constexpr std::array kPresetNames = {kSkinPreset, kSoftTissuePreset, kBonePreset,
                                            kSegmentPreset};

}  // namespace isomesh
