#include "server/import/formats/label_xml.h"

#include <array>
#include <exception>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <expat.h>

#include "base/text.h"
#include "proto/error.h"
#include "server/import/label_table.h"

namespace isomesh::import {
namespace {

using Attributes = std::map<std::string, std::string, std::less<>>;

std::string_view value_of(const Attributes& attributes, std::string_view name) {
  const auto found = attributes.find(name);
  return found == attributes.end() ? std::string_view{} : std::string_view(found->second);
}

std::optional<std::string> color_of(const Attributes& attributes) {
  std::array<double, 3> parts = {};
  std::size_t at = 0;
  for (const char* const name : {"Red", "Green", "Blue"}) {
    const auto part = parse_double(value_of(attributes, name));
    if (!part) return std::nullopt;
    parts[at++] = *part;
  }
  return label_color(parts);
}

// "1" "liver" "2" "spleen" ..., between the tags of an element of their own.
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

// Exceptions cannot pass through the C library, so they are kept until parsing has stopped.
class Parser {
 public:
  explicit Parser(std::uint64_t volume) : volume_(volume), parser_(::XML_ParserCreate(nullptr)) {
    if (!parser_) throw Error(ErrorCode::kInternal, "XML_ParserCreate failed.");
    ::XML_SetUserData(parser_.get(), this);
    ::XML_SetElementHandler(parser_.get(), &Parser::on_start, &Parser::on_end);
    ::XML_SetCharacterDataHandler(parser_.get(), &Parser::on_text);
    ::XML_SetStartDoctypeDeclHandler(parser_.get(), &Parser::on_doctype);
  }

  std::vector<LabelEntry> parse(std::string_view text) {
    const auto status =
        ::XML_Parse(parser_.get(), text.data(), static_cast<int>(text.size()), XML_TRUE);
    if (failure_) std::rethrow_exception(failure_);
    if (status != XML_STATUS_OK && !is_full_) return {};
    return std::move(entries_);
  }

 private:
  struct Free {
    void operator()(XML_Parser parser) const { ::XML_ParserFree(parser); }
  };

  template <class Action>
  void guarded(const Action& action) {
    if (failure_) return;
    try {
      action();
    } catch (...) {
      failure_ = std::current_exception();
      ::XML_StopParser(parser_.get(), XML_FALSE);
    }
  }

  static void XMLCALL on_start(void* self, const XML_Char* name, const XML_Char** pairs) {
    auto& parser = *static_cast<Parser*>(self);
    parser.guarded([&] { parser.start(name, pairs); });
  }
  static void XMLCALL on_end(void* self, const XML_Char* name) {
    auto& parser = *static_cast<Parser*>(self);
    parser.guarded([&] { parser.end(name); });
  }
  static void XMLCALL on_text(void* self, const XML_Char* text, int count) {
    auto& parser = *static_cast<Parser*>(self);
    parser.guarded([&] {
      if (parser.is_in_text_) parser.text_.append(text, static_cast<std::size_t>(count));
    });
  }
  // A few lines of nested entities expand to gigabytes.
  static void XMLCALL on_doctype(void* self, const XML_Char*, const XML_Char*, const XML_Char*,
                                 int) {
    ::XML_StopParser(static_cast<Parser*>(self)->parser_.get(), XML_FALSE);
  }

  void start(std::string_view name, const XML_Char** pairs) {
    attributes_.clear();
    for (; pairs[0] != nullptr; pairs += 2) attributes_.emplace(pairs[0], pairs[1]);
    if (name == "VolumeInformation") {
      is_of_volume_ = parse_uint64(value_of(attributes_, "Index")).value_or(0) == volume_;
    }
    is_in_text_ = (name == "Label" && is_of_volume_) ||
                  (name == "AFNI_atr" && value_of(attributes_, "atr_name") == "VALUE_LABEL_DTABLE");
    text_.clear();
  }

  void end(std::string_view name) {
    if (is_in_text_ && name == "Label") {
      if (const auto label = parse_int64(value_of(attributes_, "Key"))) {
        entries_.push_back(
            {.label = *label, .name = label_name(text_), .color = color_of(attributes_)});
      }
    } else if (is_in_text_ && name == "AFNI_atr") {
      for (LabelEntry& entry : afni_labels(text_)) entries_.push_back(std::move(entry));
    }
    is_in_text_ = false;
    if (entries_.size() <= Volume::kMostLabels) return;
    is_full_ = true;
    ::XML_StopParser(parser_.get(), XML_FALSE);
  }

  const std::uint64_t volume_;
  std::unique_ptr<std::remove_pointer_t<XML_Parser>, Free> parser_;
  std::vector<LabelEntry> entries_;
  Attributes attributes_;     // of the last element that began
  std::string text_;          // within it
  bool is_in_text_ = false;   // that is kept
  bool is_of_volume_ = true;  // where no element says of which
  bool is_full_ = false;
  std::exception_ptr failure_;
};

}  // namespace

std::vector<LabelEntry> labels_of_xml(std::string_view text, std::uint64_t volume) {
  return Parser(volume).parse(text);
}

}  // namespace isomesh::import
