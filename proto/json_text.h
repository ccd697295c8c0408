// The only way from a text to a JSON value.
#pragma once

#include <algorithm>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

namespace isomesh {

// True if arrays and objects are nested deeper than in any JSON of the API. The library copies and
// writes each level in a call of its own, so such a value would exhaust the stack.
inline bool is_nested_too_deeply(std::string_view text) {
  constexpr int kDeepest = 256;
  int depth = 0;
  bool is_in_string = false;
  for (std::size_t at = 0; at < text.size(); ++at) {
    const char c = text[at];
    if (c == '"') {
      is_in_string = !is_in_string;
    } else if (is_in_string) {
      if (c == '\\') ++at;
    } else if (c == '[' || c == '{') {
      if (++depth > kDeepest) return true;
    } else if (c == ']' || c == '}') {
      --depth;
    }
  }
  return false;
}

// As nlohmann's parse() with these options, but without its two ends: the library also takes a NUL
// byte for the end, and ignores what follows. No JSON text has such a byte, nor any other control
// character in its place, so the text is malformed there. So is one that is nested too deeply.
template <class Value, class... Options>
Value parse_json(std::string_view text, const Options&... options) {
  constexpr char kAnotherControlCharacter = '\x01';
  if (is_nested_too_deeply(text)) {
    return Value::parse(std::string_view(&kAnotherControlCharacter, 1), options...);
  }
  if (text.find('\0') == std::string_view::npos) return Value::parse(text, options...);
  std::string marked(text);
  std::ranges::replace(marked, '\0', kAnotherControlCharacter);
  return Value::parse(marked, options...);
}

// Tells a text's parts to nlohmann's interface for events, until the text ends or is malformed.
template <class Value, class Events>
void read_json_events(std::string_view text, Events& events) {
  Value::sax_parse(text, &events, Value::input_format_t::json, false);
}

}  // namespace isomesh
