// What is known of the labels of a segmentation. Plain values.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace isomesh {

// What a file says of one of its labels. Segments are named after organs, so that names may be
// shown wherever the volume is.
struct LabelEntry {
  static constexpr std::size_t kMostNameBytes = 255;

  std::int64_t label = 0;
  std::string name = {};                  // UTF-8 without control characters; may be empty
  std::optional<std::string> color = {};  // as is_color() has it
  // The sample values that belong to it, ascending; empty: its own number alone. Where segments
  // overlap, values number their combinations, and one value belongs to several labels.
  std::vector<std::int64_t> values = {};

  bool operator==(const LabelEntry&) const = default;
};

// Whether that is "#rrggbb", in lower case.
bool is_color(std::string_view text);

// One label of a volume: what its samples say, and what its file did.
struct VolumeLabel {
  std::int64_t label = 0;
  std::uint64_t voxels = 0;  // at least 1
  double volume_mm3 = 0;     // of so many voxels
  // The smallest and the largest sample along x, y and z that has it.
  std::array<std::uint32_t, 3> low = {0, 0, 0};
  std::array<std::uint32_t, 3> high = {0, 0, 0};
  // The smallest and the largest corner, in millimetres (LPS), of the box of these voxels.
  std::array<std::array<double, 3>, 2> bounds = {};
  std::optional<std::string> name = {};
  std::optional<std::string> color = {};  // as is_color() has it

  bool operator==(const VolumeLabel&) const = default;
};

struct VolumeLabels {
  std::string volume;
  std::int64_t background = 0;
  std::vector<VolumeLabel> labels;  // ascending, at most Volume::kMostLabels, or a page of them
  std::optional<std::string> next = {};  // the cursor of the next page

  bool operator==(const VolumeLabels&) const = default;
};

// Which labels of a segmentation a job separates.
struct LabelChoice {
  std::vector<std::int64_t> values;  // empty: all that the volume has

  bool is_all() const { return values.empty(); }
  bool operator==(const LabelChoice&) const = default;
};

using LabelTexts = std::map<std::int64_t, std::string>;
using LabelValues = std::map<std::int64_t, std::vector<std::int64_t>>;

}  // namespace isomesh
