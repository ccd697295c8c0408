#include "base/xml.h"

namespace isomesh {

std::string xml_escaped(std::string_view text) {
  constexpr std::string_view kReplacement = "\uFFFD";
  std::string result;
  for (std::size_t at = 0; at < text.size(); ++at) {
    const char c = text[at];
    const bool is_noncharacter = text.substr(at).starts_with("\xEF\xBF\xBE") ||  // U+FFFE
                                 text.substr(at).starts_with("\xEF\xBF\xBF");
    if (is_noncharacter) {
      result += kReplacement;
      at += 2;
    } else if (c == '&') {
      result += "&amp;";
    } else if (c == '<') {
      result += "&lt;";
    } else if (c == '>') {
      result += "&gt;";
    } else if (c == '"') {
      result += "&quot;";
    } else if (static_cast<unsigned char>(c) < ' ') {
      result += kReplacement;
    } else {
      result += c;
    }
  }
  return result;
}

}  // namespace isomesh
