#include "server/import/formats/nrrd_segments.h"

#include <algorithm>
#include <optional>
#include <set>
#include <string>

#include "base/text.h"
#include "proto/samples.h"
#include "server/import/labels/label_table.h"

namespace isomesh::import {
namespace {

struct Segment {
  std::uint64_t layer = 0;
  std::int64_t value = 1;
  LabelEntry entry;  // its label is not set yet
};

// Returns an empty text if the header does not have it.
std::string_view own_value(const NrrdFields& fields, std::size_t segment, std::string_view key) {
  return value_of(fields, own_key("Segment" + std::to_string(segment) + '_' + std::string(key)));
}

bool is_told(const NrrdFields& fields, std::size_t segment) {
  return std::ranges::any_of(
      std::initializer_list<std::string_view>{"ID", "Name", "LabelValue", "Layer"},
      [&](std::string_view key) { return !own_value(fields, segment, key).empty(); });
}

std::int64_t number_of(const NrrdFields& fields, std::size_t segment, std::string_view key,
                       std::int64_t otherwise) {
  const std::string_view text = own_value(fields, segment, key);
  if (text.empty()) return otherwise;
  if (const auto number = parse_int64(text)) return *number;
  throw_unusable("The NRRD header's \"Segment" + std::to_string(segment) + '_' + std::string(key) +
                 "\" is " + in_quotes(text) + ", not a whole number.");
}

// Three numbers, 0..1.
std::optional<std::string> color_of(std::string_view text) {
  const std::vector<std::string_view> parts = words(text);
  std::array<double, 3> color = {};
  if (parts.size() != color.size()) return std::nullopt;
  for (std::size_t at = 0; at < color.size(); ++at) {
    const auto part = parse_double(parts[at]);
    if (!part) return std::nullopt;
    color[at] = *part;
  }
  return label_color(color);
}

// Segments without layers and values are those of old versions: one segment per layer if there are
// several.
std::vector<Segment> segments_of(const NrrdFields& fields, std::uint64_t layers) {
  std::vector<Segment> segments;
  for (std::size_t at = 0; is_told(fields, at); ++at) {
    const std::int64_t usual = at < layers ? static_cast<std::int64_t>(at) : 0;
    const std::int64_t layer = number_of(fields, at, "Layer", usual);
    if (layer < 0 || static_cast<std::uint64_t>(layer) >= layers) {
      throw_unusable("The NRRD header's segment " + std::to_string(at) + " is in layer " +
                     std::to_string(layer) + ", but the file has " + std::to_string(layers) +
                     " layers.");
    }
    segments.push_back({.layer = static_cast<std::uint64_t>(layer),
                        .value = number_of(fields, at, "LabelValue", 1),
                        .entry = {.name = label_name(own_value(fields, at, "Name")),
                                  .color = color_of(own_value(fields, at, "Color"))}});
  }
  return segments;
}

void set_own_values(std::vector<Segment> segments, std::uint64_t layer, SourceVolume& volume) {
  std::vector<LabelEntry> entries;
  for (Segment& segment : segments) {
    if (segment.layer != layer) continue;
    segment.entry.label = segment.value;
    entries.push_back(std::move(segment.entry));
  }
  volume.labels = label_table(std::move(entries));
}

bool is_label(std::int64_t value) {
  return value > 0 && value <= static_cast<std::int64_t>(Volume::kMostLabels);
}

void set_layers(std::vector<Segment> segments, bool is_interleaved, SourceVolume& volume) {
  SegmentLayers layers = {.is_interleaved = is_interleaved, .labels = {}};
  std::int64_t next = 1;
  for (const Segment& segment : segments) {
    if (is_label(segment.value)) next = std::max(next, segment.value + 1);
  }
  std::set<std::int64_t> taken;
  std::vector<LabelEntry> entries;
  for (Segment& segment : segments) {
    if (segment.value == 0 || layers.labels.contains({segment.layer, segment.value})) continue;
    const bool keeps = is_label(segment.value) && taken.insert(segment.value).second;
    const std::int64_t label = keeps ? segment.value : next++;
    if (!is_label(label))
      throw_unusable("The segmentation needs labels above 65535, the largest that is supported.");
    layers.labels[{segment.layer, segment.value}] = static_cast<std::uint32_t>(label);
    segment.entry.label = label;
    entries.push_back(std::move(segment.entry));
  }
  volume.labels = label_table(std::move(entries));
  volume.layers = std::move(layers);
}

}  // namespace

bool has_segments(const NrrdFields& fields) { return is_told(fields, 0); }

void set_segments(const NrrdFields& fields, bool is_interleaved, bool is_layer_chosen,
                  SourceVolume& volume) {
  std::vector<Segment> segments = segments_of(fields, volume.chosen.count);
  if (volume.chosen.count == 1 || is_layer_chosen) {
    return set_own_values(std::move(segments), volume.chosen.index, volume);
  }
  set_layers(std::move(segments), is_interleaved, volume);
}

}  // namespace isomesh::import
