#include "server/http/guards/origin.h"

#include <algorithm>
#include <cstdint>
#include <optional>

#include <arpa/inet.h>
#include <netinet/in.h>

#include "base/log.h"
#include "base/text.h"
#include "proto/error.h"
#include "server/http/limits.h"
#include "server/net/address.h"

namespace isomesh::http {
namespace {

constexpr const char* kOrigin = "Origin";

bool is_loopback_name(const std::string& host) {
  return host == "[::1]" || net::Address{.host = host, .unix_path = {}}.is_loopback();
}

bool is_allowed(const OriginRules& rules, std::string_view origin) {
  return std::ranges::any_of(rules.cors_origins, [&](const std::string& allowed) {
    return allowed == "*" || lower(allowed) == lower(origin);
  });
}

// True if the page came from this server. Schemes may differ: a proxy may have added TLS.
bool is_same(std::string_view origin, std::string_view host) {
  const std::size_t authority = origin.find("://");
  return authority != std::string_view::npos && lower(origin.substr(authority + 3)) == lower(host);
}

}  // namespace

std::string origin_of(std::string_view address) {
  constexpr std::string_view kMark = "://";
  const std::size_t mark = address.find(kMark);
  const bool has_scheme = mark != std::string_view::npos;
  const std::string scheme = has_scheme ? lower(address.substr(0, mark)) : "https";
  if (has_scheme) address.remove_prefix(mark + kMark.size());
  const std::string_view authority = address.substr(0, address.find_first_of("/?#\\"));
  const std::string host = host_of(authority);
  constexpr std::string_view kOfHosts = "-._[]:";
  const bool is_host = !host.empty() && std::ranges::all_of(host, [&](char c) {
    return is_letter_or_digit(c) || kOfHosts.find(c) != std::string_view::npos;
  });
  if (!is_host || (scheme != "http" && scheme != "https")) return {};
  const std::string_view port = authority.substr(std::min(host.size() + 1, authority.size()));
  const auto number = port.empty() ? std::optional<std::int64_t>(0) : parse_int64(port);
  if (!number || *number > 65535) return {};
  const bool is_implied = *number == 0 || *number == (scheme == "http" ? 80 : 443);
  return scheme + std::string(kMark) + host + (is_implied ? "" : ':' + std::to_string(*number));
}

std::string host_of(std::string_view authority) {
  const bool is_v6 = authority.starts_with('[');
  const std::size_t bracket = is_v6 ? authority.find(']') : 0;
  if (bracket == std::string_view::npos) return {};
  const std::size_t colon = std::min(authority.find(':', bracket), authority.size());
  const std::string_view port = authority.substr(std::min(colon + 1, authority.size()));
  const bool is_port = std::ranges::all_of(port, [](char c) { return c >= '0' && c <= '9'; });
  return is_port ? lower(authority.substr(0, colon)) : "";
}

std::string host_named(const std::string& setting) {
  in6_addr address = {};
  const bool is_bare_v6 = ::inet_pton(AF_INET6, setting.c_str(), &address) == 1;
  return host_of(is_bare_v6 ? '[' + setting + ']' : setting);
}

void check_origin(const OriginRules& rules, const Request& request) {
  const std::string_view host = request.header("Host");
  if (rules.check_host) {
    const std::string name = host_of(host);
    const bool is_ours =
        is_loopback_name(name) || (!name.empty() && std::ranges::count(rules.hosts, name) > 0);
    if (!is_ours && (!host.empty() || request.version != "HTTP/1.0")) {
      throw Error(ErrorCode::kForbidden, "the Host header does not name this service");
    }
  }
  const bool changes =
      request.method != "GET" && request.method != "HEAD" && request.method != "OPTIONS";
  if (changes && is_of_foreign_page(rules, request)) {
    throw Error(ErrorCode::kForbidden,
                "pages of this origin may not use the service; --cors-origin allows them");
  }
}

bool is_of_foreign_page(const OriginRules& rules, const Request& request) {
  const std::string_view origin = request.header(kOrigin);
  return request.has_header(kOrigin) && !is_same(origin, request.header("Host")) &&
         !is_allowed(rules, origin);
}

void RefusedOrigins::tell(std::string_view origin) {
  constexpr std::size_t kLongest = 200;
  const std::string shown(origin.substr(0, kLongest));
  const Lock lock(mutex_);
  if (told_.size() >= limits::kMostOriginsLogged || !told_.insert(shown).second) return;
  LogLine("origin_refused", LogLevel::kWarn)
      .add("origin", shown)
      .add("reason", told_.size() < limits::kMostOriginsLogged
                         ? "pages of this origin may not use the service; --cors-origin allows them"
                         : "pages of this origin may not use the service; no further origins are "
                           "logged");
}

void allow_reading(const OriginRules& rules, const Request& request, Response& response) {
  if (rules.cors_origins.empty()) return;
  response.add_header("Vary", kOrigin);
  const std::string_view origin = request.header(kOrigin);
  if (origin.empty() || !is_allowed(rules, origin)) return;
  response.set_header("Access-Control-Allow-Origin", origin);
  response.set_header("Access-Control-Expose-Headers",
                      "Accept-Ranges, Allow, Content-Disposition, Content-Range, ETag, "
                      "Isomesh-Notes, Isomesh-Sample-Type, Isomesh-Slice, Isomesh-Upload, Link, "
                      "Location, Repr-Digest, "
                      "Retry-After, Server-Timing, Upload-Complete, "
                      "Upload-Length, Upload-Limit, Upload-Offset, X-Request-Id");
}

bool is_preflight(const OriginRules& rules, const Request& request) {
  return request.method == "OPTIONS" && request.has_header("Access-Control-Request-Method") &&
         is_allowed(rules, request.header(kOrigin));
}

void answer_preflight(const std::string& methods, Response& response) {
  response.status = 204;
  response.set_header("Access-Control-Allow-Methods", methods);
  response.set_header(
      "Access-Control-Allow-Headers",
      "Authorization, Content-Digest, Content-Disposition, Content-Type, "
      "Idempotency-Key, If-Match, If-None-Match, If-Range, Last-Event-ID, Prefer, "
      "Range, Repr-Digest, Upload-Complete, Upload-Length, Upload-Offset, traceparent");
  response.set_header("Access-Control-Max-Age", "600");
}

}  // namespace isomesh::http
