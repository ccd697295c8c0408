// The only way from a text to a JSON value.
#pragma once

#include <algorithm>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

namespace isomesh {

// As nlohmann's parse() with these options, but without its two ends: the library also takes a NUL
// byte for the end, and ignores what follows. No JSON text has such a byte, nor any other control
// character in its place, so the text is malformed there.
template <class Value, class... Options>
Value parse_json(std::string_view text, const Options&... options) {
  constexpr char kAnotherControlCharacter = '\x01';
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
