#include "server/http/oidc/provider_address.h"

#include <algorithm>
#include <memory>
#include <string_view>

#include <curl/curl.h>

#include "base/text.h"

namespace isomesh::oidc {
namespace {

constexpr std::size_t kLongestAddress = 1024;

// The parser of the connection itself: two parsers may see two hosts.
class ParsedUrl {
 public:
  explicit ParsedUrl(const std::string& text) : url_(curl_url()) {
    is_valid_ = url_ && text.size() <= kLongestAddress &&
                std::ranges::all_of(text, [](char c) { return c > ' ' && c <= '~'; }) &&
                curl_url_set(url_.get(), CURLUPART_URL, text.c_str(), 0) == CURLUE_OK;
  }

  bool is_valid() const { return is_valid_; }

  // Empty if there is none.
  std::string part(CURLUPart part) const {
    char* text = nullptr;
    if (!is_valid_ || curl_url_get(url_.get(), part, &text, 0) != CURLUE_OK) return {};
    std::string result(text);
    curl_free(text);
    return result;
  }

 private:
  struct Cleanup {
    void operator()(CURLU* url) const { curl_url_cleanup(url); }
  };
  std::unique_ptr<CURLU, Cleanup> url_;
  bool is_valid_ = false;
};

// Other characters could end the entry of a content policy.
bool is_host_text(const std::string& host) {
  constexpr std::string_view kOfHosts = "-._[]:";
  return !host.empty() && std::ranges::all_of(host, [&](char c) {
    return is_letter_or_digit(c) || kOfHosts.find(c) != std::string_view::npos;
  });
}

bool is_loopback_host(const std::string& host) {
  return host == "localhost" || host == "127.0.0.1" || host == "[::1]";
}

}  // namespace

std::string wrong_address(const std::string& url, Plain plain) {
  const ParsedUrl parsed(url);
  const std::string scheme = parsed.part(CURLUPART_SCHEME);
  const std::string host = parsed.part(CURLUPART_HOST);
  if (!parsed.is_valid() || !is_host_text(host)) return "is no URL such as https://login.example";
  if (!parsed.part(CURLUPART_USER).empty() || !parsed.part(CURLUPART_FRAGMENT).empty()) {
    return "must have neither a login nor a fragment";
  }
  if (scheme == "https") return {};
  if (scheme == "http" && plain == Plain::kOnLoopback && is_loopback_host(host)) return {};
  return plain == Plain::kOnLoopback
             ? "must begin with https://; http is for loopback addresses only"
             : "must begin with https://";
}

std::string wrong_issuer(const std::string& url) {
  const std::string wrong = wrong_address(url, Plain::kOnLoopback);
  if (!wrong.empty()) return wrong;
  return url.find('?') == std::string::npos ? "" : "must have no query";
}

bool is_plain_http(const std::string& url) {
  return ParsedUrl(url).part(CURLUPART_SCHEME) == "http";
}

std::string page_origin_of(const std::string& url) {
  const ParsedUrl parsed(url);
  const std::string port = parsed.part(CURLUPART_PORT);
  return parsed.part(CURLUPART_SCHEME) + "://" + lower(parsed.part(CURLUPART_HOST)) +
         (port.empty() ? "" : ':' + port);
}

}  // namespace isomesh::oidc
