#include "server/http/guards/origin.h"

#include <algorithm>

#include "base/text.h"
#include "proto/error.h"
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

std::string host_of(std::string_view authority) {
  const bool is_v6 = authority.starts_with('[');
  const std::size_t bracket = is_v6 ? authority.find(']') : 0;
  if (bracket == std::string_view::npos) return {};
  const std::size_t colon = std::min(authority.find(':', bracket), authority.size());
  const std::string_view port = authority.substr(std::min(colon + 1, authority.size()));
  const bool is_port = std::ranges::all_of(port, [](char c) { return c >= '0' && c <= '9'; });
  return is_port ? lower(authority.substr(0, colon)) : "";
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
  if (!changes || !request.has_header(kOrigin)) return;
  const std::string_view origin = request.header(kOrigin);
  if (!is_same(origin, host) && !is_allowed(rules, origin)) {
    throw Error(ErrorCode::kForbidden, "pages of this origin may not use the service");
  }
}

void allow_reading(const OriginRules& rules, const Request& request, Response& response) {
  if (rules.cors_origins.empty()) return;
  response.add_header("Vary", kOrigin);
  const std::string_view origin = request.header(kOrigin);
  if (origin.empty() || !is_allowed(rules, origin)) return;
  response.set_header("Access-Control-Allow-Origin", origin);
  response.set_header(
      "Access-Control-Expose-Headers",
      "Accept-Ranges, Allow, Content-Disposition, Content-Range, ETag, "
      "Isomesh-Upload, Location, Repr-Digest, Retry-After, Server-Timing, Upload-Complete, "
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
