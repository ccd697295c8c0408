#include "server/http/requests/header_parameter.h"

#include <algorithm>
#include <cstddef>

#include "base/text.h"
#include "server/net/request_head.h"

namespace isomesh::http {
namespace {

// The end of the value at the beginning of the text: the next semicolon outside of quotes.
std::size_t end_of_value(std::string_view text) {
  bool is_quoted = false;
  for (std::size_t at = 0; at < text.size(); ++at) {
    if (text[at] == ';' && !is_quoted) return at;
    if (text[at] == '"') is_quoted = !is_quoted;
    if (text[at] == '\\' && is_quoted) ++at;
  }
  return text.size();
}

}  // namespace

std::string header_parameter(std::string_view header, std::string_view name) {
  header.remove_prefix(end_of_value(header));
  while (!header.empty()) {
    header.remove_prefix(1);  // the semicolon
    const std::string_view parameter = header.substr(0, end_of_value(header));
    const std::size_t equals = std::min(parameter.find('='), parameter.size());
    if (equals < parameter.size() && net::equal_names(trimmed(parameter.substr(0, equals)), name)) {
      return unquoted(parameter.substr(equals + 1));
    }
    header.remove_prefix(parameter.size());
  }
  return {};
}

std::string unquoted(std::string_view text) {
  text = trimmed(text);
  if (!text.starts_with('"')) return std::string(text);
  std::string value;
  for (std::size_t at = 1; at < text.size() && text[at] != '"'; ++at) {
    if (text[at] == '\\' && at + 1 < text.size()) ++at;
    value += text[at];
  }
  return value;
}

}  // namespace isomesh::http
