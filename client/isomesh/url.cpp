#include "client/isomesh/url.h"

#include <algorithm>
#include <charconv>

#include "proto/error.h"

namespace isomesh {
namespace {

// The longest name that DNS has.
constexpr std::size_t kLongestHost = 253;

[[noreturn]] void refuse(const std::string& message) { throw invalid_parameter("server", message); }

bool is_unreserved(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
         c == '.' || c == '_' || c == '~';
}

bool take_prefix(std::string_view& text, std::string_view prefix) {
  if (!text.starts_with(prefix)) return false;
  text.remove_prefix(prefix.size());
  return true;
}

int parse_port(std::string_view text) {
  int port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  if (error != std::errc{} || end != text.data() + text.size() || port < 1 || port > 65535) {
    refuse("the port must be a number from 1 to 65535");
  }
  return port;
}

std::string parse_host(std::string_view text, bool bracketed) {
  const bool clean = std::ranges::all_of(
      text, [&](char c) { return is_unreserved(c) || (bracketed && c == ':'); });
  if (text.empty() || text.size() > kLongestHost || !clean) {
    refuse("must be http://HOST:PORT, https://HOST:PORT or unix:PATH");
  }
  return std::string(text);
}

}  // namespace

ServerAddress parse_server_address(std::string_view url) {
  ServerAddress address;
  if (take_prefix(url, "unix:")) {
    if (url.empty()) refuse("the path of the socket is missing");
    return {.kind = ServerAddress::Kind::kUnix, .host = std::string(url)};
  }
  if (take_prefix(url, "https://")) {
    address.kind = ServerAddress::Kind::kHttps;
    address.port = 443;
  } else if (!take_prefix(url, "http://")) {
    refuse("must begin with http://, https:// or unix:");
  }
  if (url.ends_with('/')) url.remove_suffix(1);

  const bool bracketed = take_prefix(url, "[");
  const std::size_t host_end = bracketed ? url.find(']') : std::min(url.find(':'), url.size());
  if (host_end == std::string_view::npos) refuse("the bracket of the address is not closed");
  address.host = parse_host(url.substr(0, host_end), bracketed);
  url.remove_prefix(host_end + (bracketed ? 1 : 0));
  if (url.empty()) return address;
  if (!take_prefix(url, ":")) refuse("must be http://HOST:PORT, https://HOST:PORT or unix:PATH");
  address.port = parse_port(url);
  return address;
}

std::string percent_encode(std::string_view text) {
  constexpr std::string_view kHex = "0123456789ABCDEF";
  std::string encoded;
  encoded.reserve(text.size());
  for (const char c : text) {
    if (is_unreserved(c)) {
      encoded += c;
    } else {
      const auto byte = static_cast<unsigned char>(c);
      encoded += '%';
      encoded += kHex[byte >> 4];
      encoded += kHex[byte & 15];
    }
  }
  return encoded;
}

std::string path_segment(std::string_view text) {
  if (text.empty() || text == "." || text == "..") {
    throw invalid_parameter("id", "\"" + std::string(text) + "\" is not an identifier");
  }
  return percent_encode(text);
}

std::string query_string(const std::vector<std::pair<std::string, std::string>>& pairs) {
  std::string query;
  for (const auto& [name, value] : pairs) {
    query += (query.empty() ? '?' : '&') + percent_encode(name) + '=' + percent_encode(value);
  }
  return query;
}

}  // namespace isomesh
