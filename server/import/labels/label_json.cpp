#include "server/import/labels/label_json.h"

#include <array>
#include <optional>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/text.h"
#include "server/import/labels/label_table.h"

namespace isomesh::import {
namespace {

// Sorted objects: those in the order of the text take quadratic time to read.
using Sorted = nlohmann::json;

std::optional<std::int64_t> label_of(const Sorted& value) {
  if (value.is_string()) return parse_int64(value.get_ref<const std::string&>());
  if (!value.is_number_integer()) return std::nullopt;
  const auto label = value.get<std::int64_t>();
  // Read as signed, a number that is too large is negative.
  if (value.is_number_unsigned() && label < 0) return std::nullopt;
  return label;
}

std::optional<LabelEntry> entry_of(const std::optional<std::int64_t>& label, const Sorted& name) {
  if (!label || !name.is_string()) return std::nullopt;
  const auto& text = name.get_ref<const std::string&>();
  if (trimmed(text).empty() || has_control_characters(text)) return std::nullopt;
  return LabelEntry{.label = *label, .name = label_name(text)};
}

// A member whose name is the label's number or, below "labels", whose value is. Elsewhere a name
// with a number may be any setting.
std::optional<LabelEntry> entry_of_member(const std::string& name, const Sorted& value,
                                          bool is_below_labels) {
  if (value.is_number() && is_below_labels) return entry_of(label_of(value), name);
  return entry_of(parse_int64(name), value);
}

std::optional<std::string> color_of(const Sorted& parts) {
  if (!parts.is_array() || parts.size() < 3) return std::nullopt;
  std::array<double, 3> color = {};
  for (std::size_t at = 0; at < color.size(); ++at) {
    if (!parts[at].is_number()) return std::nullopt;
    color[at] = parts[at].get<double>();
  }
  return label_color(color);
}

std::optional<LabelEntry> entry_of_segment(const Sorted& segment) {
  const auto label = segment.find("labelValue");
  const auto name = segment.find("name");
  if (!segment.is_object() || label == segment.end() || name == segment.end()) return std::nullopt;
  auto entry = entry_of(label_of(*label), *name);
  const auto color = segment.find("color");
  if (entry && color != segment.end()) entry->color = color_of(*color);
  return entry;
}

std::vector<LabelEntry> entries_of(const Sorted& table, bool is_below_labels) {
  if (!table.is_structured() || table.size() > Volume::kMostLabels) return {};
  std::vector<LabelEntry> labels;
  for (const auto& [name, value] : table.items()) {
    auto entry =
        table.is_array() ? entry_of_segment(value) : entry_of_member(name, value, is_below_labels);
    if (!entry) return {};
    labels.push_back(*std::move(entry));
  }
  return labels;
}

}  // namespace

std::vector<LabelEntry> labels_of_json(std::string_view text) {
  const Sorted document = Sorted::parse(text, nullptr, false);
  if (document.is_discarded()) return {};
  const auto labels = document.find("labels");
  const bool has_labels = labels != document.end();
  return entries_of(has_labels ? *labels : document, has_labels);
}

}  // namespace isomesh::import
