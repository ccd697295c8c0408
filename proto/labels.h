// The labels of a segmentation. Plain values.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace isomesh {

// Whole numbers beyond it, either way, are strings in JSON: many programs would round them.
inline constexpr std::int64_t kMostExactNumber = (std::int64_t{1} << 53) - 1;

// A label as a file describes it. Segments are named after organs, so names may be shown wherever
// the volume is.
struct LabelEntry {
  static constexpr std::size_t kMostNameBytes = 255;

  std::int64_t label = 0;
  std::string name = {};                  // UTF-8 without control characters; may be empty
  std::optional<std::string> color = {};  // see is_color()
  // The sample values of the label, ascending; empty: only its own number. Overlapping segments
  // share values: each value is a combination of labels.
  std::vector<std::int64_t> values = {};

  bool operator==(const LabelEntry&) const = default;
};

// True for "#rrggbb" in lower case.
bool is_color(std::string_view text);

// One label of a volume, from its samples and its file.
struct VolumeLabel {
  std::int64_t label = 0;
  std::uint64_t voxels = 0;  // at least 1
  double volume_mm3 = 0;     // the voxels' total volume
  // The smallest and the largest index along x, y and z of its samples.
  std::array<std::uint32_t, 3> low = {0, 0, 0};
  std::array<std::uint32_t, 3> high = {0, 0, 0};
  // The bounding box of its voxels: smallest and largest corner, in millimetres (LPS).
  std::array<std::array<double, 3>, 2> bounds = {};
  std::optional<std::string> name = {};
  std::optional<std::string> color = {};  // see is_color()

  bool operator==(const VolumeLabel&) const = default;
};

struct VolumeLabels {
  std::string volume;
  std::int64_t background = 0;
  std::vector<VolumeLabel> labels;  // ascending, at most Volume::kMostLabels, or a page of them
  std::optional<std::string> next = {};  // the cursor of the next page

  bool operator==(const VolumeLabels&) const = default;
};

struct LabelChoice {
  std::vector<std::int64_t> values;  // empty: all labels of the volume

  bool is_all() const { return values.empty(); }
  bool operator==(const LabelChoice&) const = default;
};

using LabelTexts = std::map<std::int64_t, std::string>;
using LabelValues = std::map<std::int64_t, std::vector<std::int64_t>>;

}  // namespace isomesh
