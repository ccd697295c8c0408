#include "server/import/labels/label_text.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/text.h"
#include "base/xml_reader.h"
#include "proto/json_text.h"
#include "proto/types.h"
#include "server/import/labels/label_table.h"
#include "server/import/source/header_fields.h"

namespace isomesh::import {
namespace {

// --- JSON ----------------------------------------------------------------------------------------

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

// The document has one of these forms, also as its member "labels":
//   {"1": "spleen", "2": "kidney_right"}                              TotalSegmentator's class map
//   [{"labelValue": 1, "name": "spleen", "color": [0.9, 0.6, 0.5]}]   3D Slicer's segments
// or this one, as that member only:
//   {"labels": {"background": 0, "spleen": 1}}                        nnU-Net's dataset.json
std::vector<LabelEntry> labels_of_json(std::string_view text) {
  const auto document = parse_json<Sorted>(text, nullptr, false);
  if (document.is_discarded()) return {};
  const auto labels = document.find("labels");
  const bool has_labels = labels != document.end();
  return entries_of(has_labels ? *labels : document, has_labels);
}

// --- Lines ---------------------------------------------------------------------------------------

using Words = std::span<const std::string_view>;
using Color = std::array<double, 3>;

constexpr double kMostColor = 255;

struct TextEntry {
  std::int64_t label = 0;
  std::string_view name;
  // The first word of a name followed by a single number, as in MRIcron's tables.
  std::string_view name_ahead_of_number;
  std::optional<Color> color;
};

bool is_comment(std::string_view line) {
  return line.starts_with('#') || line.starts_with('%') || line.starts_with("//");
}

bool is_number(std::string_view word) { return parse_double(word).has_value(); }

std::optional<Color> color_of(Words words) {
  Color color = {};
  for (std::size_t at = 0; at < color.size(); ++at) {
    const auto part = parse_double(words[at]);
    if (!part || !(*part >= 0 && *part <= kMostColor)) return std::nullopt;
    color[at] = *part;
  }
  return color;
}

// From the beginning of the first word to the end of the last: words are views of one line.
std::string_view joined(Words words) {
  const char* const begin = words.front().data();
  const char* const end = words.back().data() + words.back().size();
  return {begin, static_cast<std::size_t>(end - begin)};
}

std::string_view without_quotes(std::string_view name) {
  if (name.size() < 2 || name.front() != '"' || name.back() != '"') return name;
  return trimmed(name.substr(1, name.size() - 2));
}

// Numbers first: a colour, optionally with an opacity or ITK-SNAP's flags.
std::optional<TextEntry> after_color(std::int64_t label, Words rest, std::size_t numbers) {
  if (numbers != 3 && numbers != 4 && numbers != 6) return std::nullopt;
  const auto color = color_of(rest);
  if (!color || numbers == rest.size()) return std::nullopt;
  const std::string_view name = without_quotes(joined(rest.subspan(numbers)));
  return TextEntry{.label = label, .name = name, .name_ahead_of_number = {}, .color = color};
}

// Name first. Three or four numbers at the end are its colour, optionally with an opacity.
std::optional<TextEntry> ahead_of_color(std::int64_t label, Words rest) {
  constexpr std::size_t kMostNumbers = 4;
  std::size_t numbers = 0;
  while (numbers < kMostNumbers && numbers + 1 < rest.size() &&
         is_number(rest[rest.size() - numbers - 1])) {
    ++numbers;
  }
  TextEntry entry = {.label = label, .name = {}, .name_ahead_of_number = {}, .color = {}};
  if (numbers >= 3) entry.color = color_of(rest.last(numbers));
  if (numbers == 1 && rest.size() == 2) entry.name_ahead_of_number = rest.front();
  entry.name = without_quotes(joined(entry.color ? rest.first(rest.size() - numbers) : rest));
  return entry;
}

std::optional<TextEntry> entry_of(std::string_view line) {
  const std::vector<std::string_view> all = words(line);
  if (all.size() < 2 || has_control_characters(line)) return std::nullopt;
  const auto label = parse_int64(all.front());
  if (!label) return std::nullopt;
  const Words rest = Words(all).subspan(1);
  const auto numbers =
      static_cast<std::size_t>(std::ranges::find_if_not(rest, is_number) - rest.begin());
  return numbers > 0 ? after_color(*label, rest, numbers) : ahead_of_color(*label, rest);
}

// MRIcron's tables have a number after each name. But names may also end with a number: then they
// would be equal without it.
bool have_numbers_behind(std::span<const TextEntry> entries) {
  std::set<std::string_view> names;
  return std::ranges::all_of(entries, [&](const TextEntry& entry) {
    return !entry.name_ahead_of_number.empty() && names.insert(entry.name_ahead_of_number).second;
  });
}

// Colours are 0 to 1 in some tables, and 0 to 255 in others.
double largest_color(std::span<const TextEntry> entries) {
  double largest = 0;
  for (const TextEntry& entry : entries) {
    if (entry.color) largest = std::max(largest, std::ranges::max(*entry.color));
  }
  return largest > 1 ? kMostColor : 1;
}

// 3D Slicer writes a space as "_".
std::string with_spaces(std::string_view name) {
  std::string spaced(name);
  std::ranges::replace(spaced, '_', ' ');
  return spaced;
}

std::vector<LabelEntry> named(std::span<const TextEntry> entries, bool is_of_slicer) {
  const bool numbered = have_numbers_behind(entries);
  const double scale = 1 / largest_color(entries);
  std::vector<LabelEntry> labels;
  for (const TextEntry& entry : entries) {
    if (entry.name == "(none)") continue;  // Slicer's name for a number without a label
    const std::string_view name = numbered ? entry.name_ahead_of_number : entry.name;
    LabelEntry label = {.label = entry.label,
                        .name = label_name(is_of_slicer ? with_spaces(name) : std::string(name))};
    if (entry.color) {
      const Color& color = *entry.color;
      label.color = label_color({color[0] * scale, color[1] * scale, color[2] * scale});
    }
    labels.push_back(std::move(label));
  }
  return labels;
}

// "#rrggbb" as three numbers up to 255.
std::optional<Color> hex_color(std::string_view text) {
  if (text.size() != 7 || text.front() != '#') return std::nullopt;
  Color color = {};
  for (std::size_t part = 0; part < color.size(); ++part) {
    const std::string_view digits = text.substr(1 + part * 2, 2);
    unsigned value = 0;
    const auto end = std::from_chars(digits.data(), digits.data() + digits.size(), value, 16);
    if (end.ptr != digits.data() + digits.size()) return std::nullopt;
    color[part] = value;
  }
  return color;
}

// BIDS's table of a segmentation: a line of names of columns, then one line for each label. Empty
// if the lines are none.
std::vector<LabelEntry> labels_of_bids(std::span<const std::string_view> lines) {
  const auto columns = split(lines.front(), '\t');
  const auto column = [&](std::string_view name) {
    return static_cast<std::size_t>(std::ranges::find(columns, name) - columns.begin());
  };
  const std::size_t index = column("index");
  const std::size_t name = column("name");
  const std::size_t color = column("color");
  if (index == columns.size() || name == columns.size()) return {};
  std::vector<LabelEntry> labels;
  for (const std::string_view line : lines.subspan(1)) {
    const auto cells = split(line, '\t');
    if (cells.size() <= std::max(index, name) || labels.size() == Volume::kMostLabels) return {};
    const auto label = parse_int64(cells[index]);
    if (!label || cells[name].empty() || has_control_characters(cells[name])) return {};
    LabelEntry entry = {.label = *label, .name = label_name(cells[name])};
    if (const auto parts = color < cells.size() ? hex_color(cells[color]) : std::nullopt) {
      const auto& [red, green, blue] = *parts;
      entry.color = label_color({red / kMostColor, green / kMostColor, blue / kMostColor});
    }
    labels.push_back(std::move(entry));
  }
  return labels;
}

// --- XML -----------------------------------------------------------------------------------------

std::optional<std::string> color_of(const HeaderTexts& attributes) {
  std::array<double, 3> parts = {};
  std::size_t at = 0;
  for (const char* const name : {"Red", "Green", "Blue"}) {
    const auto part = parse_double(value_of(attributes, name));
    if (!part) return std::nullopt;
    parts[at++] = *part;
  }
  return label_color(parts);
}

// "1" "liver" "2" "spleen" ..., as the text of one element.
std::vector<LabelEntry> afni_labels(std::string_view text) {
  std::vector<std::string_view> words;
  const std::size_t begin = text.find('>');
  if (begin == std::string_view::npos) return {};
  for (std::size_t next = text.find('"', begin); next != std::string_view::npos;) {
    const std::size_t end = text.find('"', next + 1);
    if (end == std::string_view::npos) break;
    words.push_back(text.substr(next + 1, end - next - 1));
    if (words.size() > 2 * (Volume::kMostLabels + 1)) break;
    next = text.find('"', end + 1);
  }
  std::vector<LabelEntry> entries;
  for (std::size_t at = 0; at + 1 < words.size(); at += 2) {
    const auto label = parse_int64(words[at]);
    if (label) entries.push_back({.label = *label, .name = label_name(words[at + 1])});
  }
  return entries;
}

class LabelXmlParser : public XmlHandler {
 public:
  explicit LabelXmlParser(std::uint64_t volume) : volume_(volume) {}

  std::vector<LabelEntry> parse(std::string_view text) {
    try {
      reader_.read(text, true);
    } catch (const XmlError&) {
      return {};  // labels are optional; the samples are usable without them
    }
    return std::move(entries_);
  }

 private:
  void start_element(std::string_view name, const XmlAttributes& pairs) override {
    attributes_.clear();
    pairs.for_each([&](const char* key, const char* value) { attributes_.emplace(key, value); });
    if (name == "VolumeInformation") {
      is_of_volume_ = parse_uint64(value_of(attributes_, "Index")).value_or(0) == volume_;
    }
    is_in_text_ = (name == "Label" && is_of_volume_) ||
                  (name == "AFNI_atr" && value_of(attributes_, "atr_name") == "VALUE_LABEL_DTABLE");
    text_.clear();
  }

  void text(std::string_view part) override {
    if (is_in_text_) text_ += part;
  }

  void end_element(std::string_view name) override {
    if (is_in_text_ && name == "Label") {
      if (const auto label = parse_int64(value_of(attributes_, "Key"))) {
        entries_.push_back(
            {.label = *label, .name = label_name(text_), .color = color_of(attributes_)});
      }
    } else if (is_in_text_ && name == "AFNI_atr") {
      for (LabelEntry& entry : afni_labels(text_)) entries_.push_back(std::move(entry));
    }
    is_in_text_ = false;
    if (entries_.size() > Volume::kMostLabels) reader_.stop();
  }

  const std::uint64_t volume_;
  std::vector<LabelEntry> entries_;
  HeaderTexts attributes_;  // of the last start tag
  std::string text_;
  bool is_in_text_ = false;   // true while text is collected
  bool is_of_volume_ = true;  // true if no element names a volume
  XmlReader reader_{*this};
};

}  // namespace

std::vector<LabelEntry> labels_of_text(std::string_view text) {
  constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
  if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
  const std::string_view content = trimmed(text);
  if (content.starts_with('{') || content.starts_with('[')) return labels_of_json(content);
  const std::vector<std::string_view> all = lines(text);
  if (!all.empty() && all.front().find('\t') != std::string_view::npos) {
    auto labels = labels_of_bids(all);
    if (!labels.empty()) return labels;
  }
  std::vector<TextEntry> entries;
  bool is_of_slicer = false;
  for (const std::string_view line : all) {
    if (is_comment(line)) {
      is_of_slicer = is_of_slicer || line.starts_with("# Color table file");
      continue;
    }
    const auto entry = entry_of(line);
    if (!entry || entries.size() == Volume::kMostLabels) return {};
    entries.push_back(*entry);
  }
  return named(entries, is_of_slicer);
}

std::vector<LabelEntry> labels_of_xml(std::string_view text, std::uint64_t volume) {
  return LabelXmlParser(volume).parse(text);
}

}  // namespace isomesh::import
