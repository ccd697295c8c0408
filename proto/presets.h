// The iso-values that have a name: the importer gives them to the volumes that have them, and
// requests for jobs take their names.
#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <string_view>

namespace isomesh {

struct PresetRow {
  std::string_view name;
  // Of a CT; empty: half of the largest value of a fractional segmentation.
  std::optional<double> hounsfield;
};

// Air is -1000 and water 0. Skin is the border of air. Soft tissue is midway between fat (about
// -100) and muscle and organs (about 50), so fat is excluded. Bone begins above the usual values of
// contrast agent and calcified tissue.
inline constexpr std::array kPresets = {PresetRow{"skin", -300}, PresetRow{"soft tissue", -25},
                                        PresetRow{"bone", 250}, PresetRow{"segment", {}}};

// Requests write "soft-tissue".
inline std::string name_in_requests(std::string_view preset) {
  std::string name(preset);
  std::ranges::replace(name, ' ', '-');
  return name;
}
inline std::string name_in_requests(const PresetRow& row) { return name_in_requests(row.name); }

}  // namespace isomesh
