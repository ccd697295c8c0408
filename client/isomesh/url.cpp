#include "client/isomesh/url.h"

#include <memory>
#include <new>

#include <curl/curl.h>

#include "base/text.h"
#include "proto/error.h"

namespace isomesh {
namespace {

// The longest DNS name, and a port.
constexpr std::size_t kLongestAuthority = 253 + 6;

constexpr const char* kForms = "must be http://HOST:PORT, https://HOST:PORT or unix:PATH";

[[noreturn]] void refuse(const std::string& message) { throw invalid_parameter("server", message); }

bool take_prefix(std::string_view& text, std::string_view prefix) {
  if (!text.starts_with(prefix)) return false;
  text.remove_prefix(prefix.size());
  return true;
}

// Uses the URL parser of the connection.
void check_host_and_port(const std::string& origin) {
  const std::unique_ptr<CURLU, decltype(&curl_url_cleanup)> parts(curl_url(), &curl_url_cleanup);
  if (!parts) throw std::bad_alloc();
  const CURLUcode code = curl_url_set(parts.get(), CURLUPART_URL, origin.c_str(), 0);
  if (code == CURLUE_BAD_PORT_NUMBER) refuse("the port must be a number from 1 to 65535");
  if (code != CURLUE_OK) refuse(kForms);
}

}  // namespace

ServerAddress parse_server_address(std::string_view url) {
  if (take_prefix(url, "unix:")) {
    if (url.empty()) refuse("must name the path of a socket after unix:");
    return {.origin = "http://localhost", .socket = url};
  }
  std::string_view authority = url;
  if (!take_prefix(authority, "https://") && !take_prefix(authority, "http://")) {
    refuse("must begin with http://, https:// or unix:");
  }
  if (authority.ends_with('/')) authority.remove_suffix(1);
  // libcurl also accepts a path, a query, a user, and a port that is empty or 0.
  if (authority.size() > kLongestAuthority || authority.ends_with(':') ||
      authority.ends_with(":0") || authority.find_first_of("/\\?#@") != std::string_view::npos) {
    refuse(kForms);
  }
  const std::string origin(url.begin(), authority.end());
  check_host_and_port(origin);
  return {.origin = origin};
}

std::string path_segment(std::string_view text) {
  // Servers decode an encoded slash to a separator.
  if (text.empty() || text == "." || text == ".." || text.find('/') != text.npos) {
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
