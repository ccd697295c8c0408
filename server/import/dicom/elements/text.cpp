#include "server/import/dicom/elements/text.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include <iconv.h>

#include "base/text.h"
#include "server/import/dicom/elements/tags.h"

namespace isomesh::import::dicom {
namespace {

// Implicit elements do not declare that they are names.
TextKind kind_of(Tag tag) {
  return tag == kPatientName || tag == kReferringPhysician ? TextKind::kPersonName
                                                           : TextKind::kText;
}

constexpr std::string_view kReplacement = "\xEF\xBF\xBD";
constexpr char kEscape = '\x1b';

// The bytes that a set gives a meaning to: the lower half (G0) or the upper half (G1).
enum class Bytes {
  kLower,
  kLowerPairs,               // JIS X 0208: EUC-JP with the upper bits set
  kLowerSupplementaryPairs,  // JIS X 0212: the same after a byte 0x8F
  kUpper,                    // single bytes or pairs
  kAll                       // no other set beside it
};

struct CharacterSet {
  std::string_view term;  // without the prefix "ISO_IR " or "ISO 2022 IR "
  const char* name;       // iconv's name of a converter that includes ASCII
  Bytes bytes;
  std::string_view escape;  // after the byte ESC; empty if there is none
};

constexpr const char* kAscii = "US-ASCII";
constexpr const char* kLatin1 = "ISO-8859-1";
constexpr const char* kJapanesePairs = "EUC-JP";

// PS3.3, tables C.12-2 to C.12-5. Katakana (13) is often Shift JIS in fact, which includes it; of
// the converters of Shift JIS this one leaves the backslash, which separates values. For the same
// reason the Latin letters of the set 13 are read as ASCII: they differ in the backslash and the
// tilde. The last row is an older edition of 87.
constexpr std::array kCharacterSets = {
    CharacterSet{"6", kAscii, Bytes::kLower, "(B"},
    CharacterSet{"100", kLatin1, Bytes::kUpper, "-A"},
    CharacterSet{"101", "ISO-8859-2", Bytes::kUpper, "-B"},
    CharacterSet{"109", "ISO-8859-3", Bytes::kUpper, "-C"},
    CharacterSet{"110", "ISO-8859-4", Bytes::kUpper, "-D"},
    CharacterSet{"144", "ISO-8859-5", Bytes::kUpper, "-L"},
    CharacterSet{"127", "ISO-8859-6", Bytes::kUpper, "-G"},
    CharacterSet{"126", "ISO-8859-7", Bytes::kUpper, "-F"},
    CharacterSet{"138", "ISO-8859-8", Bytes::kUpper, "-H"},
    CharacterSet{"148", "ISO-8859-9", Bytes::kUpper, "-M"},
    CharacterSet{"203", "ISO-8859-15", Bytes::kUpper, "-b"},
    CharacterSet{"166", "TIS-620", Bytes::kUpper, "-T"},
    CharacterSet{"13", "CP932", Bytes::kUpper, ")I"},
    CharacterSet{"14", kAscii, Bytes::kLower, "(J"},
    CharacterSet{"87", kJapanesePairs, Bytes::kLowerPairs, "$B"},
    CharacterSet{"159", kJapanesePairs, Bytes::kLowerSupplementaryPairs, "$(D"},
    CharacterSet{"149", "EUC-KR", Bytes::kUpper, "$)C"},
    CharacterSet{"58", "EUC-CN", Bytes::kUpper, "$)A"},
    CharacterSet{"192", "UTF-8", Bytes::kAll, ""},
    CharacterSet{"GB18030", "GB18030", Bytes::kAll, ""},
    CharacterSet{"GBK", "GBK", Bytes::kAll, ""},
    CharacterSet{"42", kJapanesePairs, Bytes::kLowerPairs, "$@"}};

constexpr const CharacterSet& kDefaultSet = kCharacterSets[0];

// Returns null if the term is unknown.
const CharacterSet* set_of(std::string_view term) {
  if (term.empty()) return &kDefaultSet;
  for (const std::string_view prefix : {"ISO_IR ", "ISO 2022 IR "}) {
    if (term.starts_with(prefix)) term.remove_prefix(prefix.size());
  }
  const auto* found = std::ranges::find(kCharacterSets, term, &CharacterSet::term);
  return found == kCharacterSets.end() ? nullptr : found;
}

// Returns null if the text does not begin with a known escape sequence.
const CharacterSet* set_after_escape(std::string_view text) {
  if (text.front() != kEscape) return nullptr;
  text.remove_prefix(1);
  const auto* found = std::ranges::find_if(kCharacterSets, [&](const CharacterSet& set) {
    return !set.escape.empty() && text.starts_with(set.escape);
  });
  return found == kCharacterSets.end() ? nullptr : found;
}

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

class Converter {
 public:
  explicit Converter(const char* from) : handle_(iconv_open("UTF-8", from)) {}
  ~Converter() {
    if (is_open()) iconv_close(handle_);
  }
  Converter(const Converter&) = delete;
  Converter& operator=(const Converter&) = delete;

  std::string convert(std::string_view text) {
    if (!is_open()) return ascii_only(text);
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
  bool is_open() const { return reinterpret_cast<std::intptr_t>(handle_) != -1; }

  iconv_t handle_;
};

// Replaces code points beyond U+10FFFF, which iconv passes from UTF-8 to UTF-8.
std::string within_unicode(std::string_view text) {
  const auto byte = [&](std::size_t at) -> unsigned {
    return at < text.size() ? static_cast<unsigned char>(text[at]) : 0;
  };
  std::string result;
  for (std::size_t at = 0; at < text.size(); ++at) {
    const bool is_beyond = byte(at) > 0xF4 || (byte(at) == 0xF4 && byte(at + 1) >= 0x90);
    if (!is_beyond) {
      result += text[at];
      continue;
    }
    result += kReplacement;
    while ((byte(at + 1) & 0xC0U) == 0x80) ++at;
  }
  return result;
}

// The sets that give the next bytes their meaning.
struct State {
  Bytes lower = Bytes::kLower;
  const char* upper = kAscii;  // the name of a converter
};

// True if no term gives the bytes of the upper half a meaning, because there are none or unknown
// ones. Programs that write such bytes nevertheless mostly mean Latin-1 or UTF-8.
bool is_undeclared(const std::vector<std::string_view>& terms) {
  return std::ranges::all_of(terms, [](std::string_view term) {
    const CharacterSet* set = set_of(term);
    return set == nullptr || set == &kDefaultSet;
  });
}

// True if the text has letters beyond ASCII, all of them in UTF-8, and no escape sequences.
bool looks_like_utf8(std::string_view text) {
  const bool is_ascii =
      std::ranges::all_of(text, [](char byte) { return static_cast<unsigned char>(byte) < 0x80; });
  return !is_ascii && text.find(kEscape) == text.npos &&
         within_unicode(Converter("UTF-8").convert(text)) == text;
}

// The state in which a text begins. Some programs omit the escape sequence of the only set with an
// upper half, which is Korean or Chinese mostly: no other meaning of such bytes is possible.
State first_state(const std::vector<std::string_view>& terms) {
  const CharacterSet* first = set_of(terms.front());
  if (first == nullptr || is_undeclared(terms)) return {.upper = kLatin1};
  if (first->bytes == Bytes::kUpper) return {.upper = first->name};
  std::set<std::string_view> others;
  const char* other = kAscii;
  for (const std::string_view term : terms) {
    const CharacterSet* set = set_of(term);
    if (set == nullptr || set->bytes != Bytes::kUpper) continue;
    other = set->name;
    others.insert(other);
  }
  return others.size() == 1 ? State{.upper = other} : State{};
}

bool is_in_pairs(char byte) { return byte > 0x20 && byte < 0x7F; }

class Decoder {
 public:
  Decoder(const State& first, TextKind kind) : first_(first), state_(first), kind_(kind) {}

  std::string decode(std::string_view text) {
    while (!text.empty()) text.remove_prefix(take(text));
    end_run();
    return std::move(result_);
  }

 private:
  // Takes an escape sequence, a pair or a byte. Returns the number of bytes.
  std::size_t take(std::string_view rest) {
    if (const CharacterSet* set = set_after_escape(rest)) {
      switch_to(*set);
      return 1 + set->escape.size();
    }
    const bool has_pairs = state_.lower != Bytes::kLower;
    if (has_pairs && is_in_pairs(rest.front())) return take_pair(rest);
    if (ends_switching(rest.front())) state_ = first_;
    if (run_name_ != state_.upper) end_run();
    run_name_ = state_.upper;
    run_ += rest.front();
    return 1;
  }

  // Some programs, for example pydicom, return from Japanese pairs with the escape sequence of an
  // upper half. The standard keeps the pairs then; such texts are read wrongly here.
  void switch_to(const CharacterSet& set) {
    const bool is_upper = set.bytes == Bytes::kUpper;
    state_.lower = is_upper ? Bytes::kLower : set.bytes;
    if (is_upper) state_.upper = set.name;
  }

  // PS3.5, 6.1.2.5.3. Bytes of pairs that look like delimiters never come here.
  bool ends_switching(char byte) const {
    constexpr std::string_view kDelimiters = "\t\n\f\r\\";
    constexpr std::string_view kOfNames = "^=";
    return kDelimiters.find(byte) != kDelimiters.npos ||
           (kind_ == TextKind::kPersonName && kOfNames.find(byte) != kOfNames.npos);
  }

  // Pairs are converted one by one: a wrong one must not shift those after it.
  std::size_t take_pair(std::string_view rest) {
    end_run();
    if (rest.size() < 2 || !is_in_pairs(rest[1])) {
      result_ += kReplacement;
      return 1;
    }
    std::string stored;
    if (state_.lower == Bytes::kLowerSupplementaryPairs) stored += '\x8f';
    for (const char byte : rest.substr(0, 2)) stored += static_cast<char>(byte | 0x80);
    const std::string letter = converter(kJapanesePairs).convert(stored);
    result_ += letter.starts_with(kReplacement) ? kReplacement : std::string_view(letter);
    return 2;
  }

  void end_run() {
    if (!run_.empty()) result_ += converter(run_name_).convert(run_);
    run_.clear();
  }

  Converter& converter(const char* name) {
    return converters_.try_emplace(std::string_view(name), name).first->second;
  }

  State first_;
  State state_;
  TextKind kind_;
  std::string run_;  // bytes for one converter
  const char* run_name_ = kAscii;
  std::map<std::string_view, Converter> converters_;
  std::string result_;
};

}  // namespace

std::string utf8(const DataSet& data, Tag tag) {
  const std::string_view text = data.text(tag);
  if (text.empty()) return {};
  const std::string_view terms =
      data.character_set ? without_padding(*data.character_set) : std::string_view();
  return decoded(text, terms, kind_of(tag));
}

std::string decoded(std::string_view text, std::string_view terms, TextKind kind) {
  const std::vector<std::string_view> parts = split(terms, '\\');
  const CharacterSet* first = set_of(parts.front());
  if (first != nullptr && first->bytes == Bytes::kAll) {
    return printable(within_unicode(Converter(first->name).convert(text)));
  }
  if (is_undeclared(parts) && looks_like_utf8(text)) return printable(text);
  return printable(Decoder(first_state(parts), kind).decode(text));
}

void load_character_sets() {
  // A module stays loaded while one of its converters is open.
  static const std::array kept = [] {
    std::array<iconv_t, kCharacterSets.size()> converters;
    std::ranges::transform(kCharacterSets, converters.begin(),
                           [](const CharacterSet& set) { return iconv_open("UTF-8", set.name); });
    return converters;
  }();
  static_cast<void>(kept);
}

}  // namespace isomesh::import::dicom
