#include "server/import/formats/nrrd_segments.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/text.h"
#include "proto/json_text.h"
#include "server/import/labels/label_table.h"

namespace isomesh::import {
namespace {

using Json = nlohmann::json;

constexpr std::string_view kModalityOfMitk = "org.mitk.multilabel.segmentation";
constexpr std::string_view kGroupsOfMitk = "org.mitk.multilabel.segmentation.labelgroups";

// --- 3D Slicer's ---------------------------------------------------------------------------------

// In private keys
// (https://slicer.readthedocs.io/en/latest/developer_guide/modules/segmentations.html).
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
std::vector<Segment> segments_of_slicer(const NrrdFields& fields, std::uint64_t layers) {
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

// --- MITK's --------------------------------------------------------------------------------------

// The value of a private pair. The format writes a line break as "\n" and a backslash as "\\".
std::string unescaped(std::string_view text) {
  std::string plain;
  for (std::size_t at = 0; at < text.size(); ++at) {
    const bool is_escape =
        text[at] == '\\' && at + 1 < text.size() && (text[at + 1] == 'n' || text[at + 1] == '\\');
    if (is_escape) ++at;
    plain += is_escape && text[at] == 'n' ? '\n' : text[at];
  }
  return plain;
}

// The format's own library escapes values, and other writers may not.
Json groups_of_text(std::string_view text) {
  Json groups = parse_json<Json>(unescaped(text), nullptr, false);
  if (groups.is_discarded()) groups = parse_json<Json>(text, nullptr, false);
  return groups;
}

// A property with the value [r, g, b], or these numbers alone.
std::optional<std::string> color_of_json(const Json& label) {
  const auto found = label.find("color");
  if (found == label.end()) return std::nullopt;
  const Json& color = found->is_object() && found->contains("value") ? (*found)["value"] : *found;
  std::array<double, 3> parts = {};
  if (!color.is_array() || color.size() < parts.size()) return std::nullopt;
  for (std::size_t at = 0; at < parts.size(); ++at) {
    if (!color[at].is_number()) return std::nullopt;
    parts[at] = color[at].get<double>();
  }
  return label_color(parts);
}

std::optional<Segment> segment_of_json(const Json& label, std::uint64_t layer) {
  if (!label.is_object()) return std::nullopt;
  const auto value = label.find("value");
  if (value == label.end() || !value->is_number_unsigned()) return std::nullopt;
  const auto number = value->get<std::uint64_t>();
  if (number == 0 || number > Volume::kMostLabels) return std::nullopt;
  const auto name = label.find("name");
  const bool is_named = name != label.end() && name->is_string();
  return Segment{.layer = layer,
                 .value = static_cast<std::int64_t>(number),
                 .entry = {.name = is_named ? label_name(name->get_ref<const std::string&>()) : "",
                           .color = color_of_json(label)}};
}

// A group is a layer, with or without labels. Damaged entries are ignored, because the samples are
// usable without names.
std::vector<Segment> segments_of_mitk(const NrrdFields& fields, std::uint64_t layers) {
  const Json groups = groups_of_text(value_of(fields, own_key(kGroupsOfMitk)));
  std::vector<Segment> segments;
  if (!groups.is_array()) return segments;
  for (std::uint64_t layer = 0; layer < std::min<std::uint64_t>(groups.size(), layers); ++layer) {
    const Json& group = groups[layer];
    if (!group.is_object() || !group.contains("labels") || !group["labels"].is_array()) continue;
    for (const Json& label : group["labels"]) {
      auto segment = segment_of_json(label, layer);
      if (segment) segments.push_back(*std::move(segment));
    }
  }
  return segments;
}

// --- Both ----------------------------------------------------------------------------------------

bool is_of_mitk(const NrrdFields& fields) {
  return fields.contains(own_key(kGroupsOfMitk)) ||
         value_of(fields, own_key("modality")) == kModalityOfMitk;
}

std::vector<Segment> segments_of(const NrrdFields& fields, std::uint64_t layers) {
  return is_of_mitk(fields) ? segments_of_mitk(fields, layers) : segments_of_slicer(fields, layers);
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

bool has_segments(const NrrdFields& fields) { return is_of_mitk(fields) || is_told(fields, 0); }

bool has_cropped_segments(const NrrdFields& fields) {
  return is_told(fields, 0) && !is_of_mitk(fields);
}

void set_segments(const NrrdFields& fields, bool is_interleaved, bool is_layer_chosen,
                  SourceVolume& volume) {
  volume.are_labels = is_of_mitk(fields);
  std::vector<Segment> segments = segments_of(fields, volume.chosen.count);
  if (volume.chosen.count == 1 || is_layer_chosen) {
    return set_own_values(std::move(segments), volume.chosen.index, volume);
  }
  set_layers(std::move(segments), is_interleaved, volume);
}

}  // namespace isomesh::import
