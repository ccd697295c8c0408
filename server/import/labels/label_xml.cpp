#include "server/import/labels/label_xml.h"

#include <array>
#include <optional>
#include <string>
#include <utility>

#include "base/text.h"
#include "base/xml_reader.h"
#include "server/import/labels/label_table.h"
#include "server/import/source/header_fields.h"

namespace isomesh::import {
namespace {

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

std::vector<LabelEntry> labels_of_xml(std::string_view text, std::uint64_t volume) {
  return LabelXmlParser(volume).parse(text);
}

}  // namespace isomesh::import
