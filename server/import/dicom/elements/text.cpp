#include "server/import/dicom/elements/text.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>

#include <iconv.h>

#include "base/text.h"
#include "server/import/dicom/elements/tags.h"

namespace isomesh::import::dicom {
namespace {

constexpr std::string_view kReplacement = "\xEF\xBF\xBD";

struct CharacterSet {
  std::string_view defined_term;  // without the prefix "ISO_IR " or "ISO 2022 IR "
  const char* name;               // iconv's name
};

constexpr std::array kCharacterSets = {
    CharacterSet{"6", "US-ASCII"},        CharacterSet{"100", "ISO-8859-1"},
    CharacterSet{"101", "ISO-8859-2"},    CharacterSet{"109", "ISO-8859-3"},
    CharacterSet{"110", "ISO-8859-4"},    CharacterSet{"144", "ISO-8859-5"},
    CharacterSet{"127", "ISO-8859-6"},    CharacterSet{"126", "ISO-8859-7"},
    CharacterSet{"138", "ISO-8859-8"},    CharacterSet{"148", "ISO-8859-9"},
    CharacterSet{"203", "ISO-8859-15"},   CharacterSet{"166", "TIS-620"},
    CharacterSet{"13", "SHIFT_JIS"},      CharacterSet{"87", "ISO-2022-JP-2"},
    CharacterSet{"159", "ISO-2022-JP-2"}, CharacterSet{"149", "EUC-KR"},
    CharacterSet{"58", "EUC-CN"},         CharacterSet{"192", "UTF-8"},
    CharacterSet{"GB18030", "GB18030"},   CharacterSet{"GBK", "GBK"}};

// Returns null if unknown.
const char* iconv_name(std::string_view term) {
  for (const std::string_view prefix : {"ISO_IR ", "ISO 2022 IR "}) {
    if (term.starts_with(prefix)) term.remove_prefix(prefix.size());
  }
  const auto* found = std::ranges::find(kCharacterSets, term,
                                        [](const CharacterSet& set) { return set.defined_term; });
  return found == kCharacterSets.end() ? nullptr : found->name;
}

// With several character sets, a text begins with the first and may switch to the others. The last
// one is used: it is multi-byte, and its converter includes the first.
const char* character_set(const DataSet& data) {
  const auto terms = data.texts(kSpecificCharacterSet);
  if (terms.empty()) return "US-ASCII";
  if (terms.size() == 1) return terms.front().empty() ? "US-ASCII" : iconv_name(terms.front());
  return iconv_name(terms.back());
}

// Korean and Chinese texts begin with an escape sequence that iconv's converters do not know.
std::string without_announcements(std::string_view text) {
  std::string result(text);
  for (const std::string_view escape : {"\x1b$)C", "\x1b$)A", "\x1b(B"}) {
    for (std::size_t at; (at = result.find(escape)) != result.npos;)
      result.erase(at, escape.size());
  }
  return result;
}

class Converter {
 public:
  explicit Converter(const char* from) : handle_(iconv_open("UTF-8", from)) {}
  ~Converter() {
    if (is_open()) iconv_close(handle_);
  }
  Converter(const Converter&) = delete;
  Converter& operator=(const Converter&) = delete;

  bool is_open() const { return reinterpret_cast<std::intptr_t>(handle_) != -1; }

  std::string convert(std::string_view text) {
    std::string source(text);
    std::string result;
    char* next = source.data();
    std::size_t left = source.size();
    while (left > 0) {
      std::array<char, 256> buffer;
      char* end = buffer.data();
      std::size_t room = buffer.size();
      const bool failed = iconv(handle_, &next, &left, &end, &room) == static_cast<std::size_t>(-1);
      const int error = errno;
      result.append(buffer.data(), end);
      if (!failed || error == E2BIG) continue;
      result += kReplacement;
      ++next;
      --left;
    }
    return result;
  }

 private:
  iconv_t handle_;
};

std::string ascii_only(std::string_view text) {
  std::string result;
  for (const char letter : text) {
    if (static_cast<unsigned char>(letter) < 0x80) {
      result += letter;
    } else {
      result += kReplacement;
    }
  }
  return result;
}

std::string converted(std::string_view text, const char* from) {
  if (from == nullptr) return ascii_only(text);
  const bool has_escapes_of_its_own = std::string_view(from).starts_with("ISO-2022");
  Converter converter(from);
  if (!converter.is_open()) return ascii_only(text);
  return converter.convert(has_escapes_of_its_own ? std::string(text)
                                                  : without_announcements(text));
}

}  // namespace

void load_character_sets() {
  // A module stays loaded while one of its converters is open.
  for (const CharacterSet& set : kCharacterSets) static_cast<void>(iconv_open("UTF-8", set.name));
}

std::string utf8(const DataSet& data, Tag tag) {
  const std::string_view text = data.text(tag);
  if (text.empty()) return {};
  return printable(converted(text, character_set(data)));
}

}  // namespace isomesh::import::dicom
