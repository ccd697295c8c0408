#include "server/http/guards/access.h"

#include <chrono>
#include <optional>
#include <utility>

#include "base/log.h"
#include "proto/error.h"
#include "server/net/address.h"

namespace isomesh::http {
namespace {

bool is_below(std::string_view path, std::string_view folder) {
  return path == folder || (path.starts_with(folder) && path[folder.size()] == '/');
}

// Sets who calls. Throws the same error for missing, malformed and unknown tokens, to give
// attackers no information. Errors about a token of the provider tell its owner what to do.
void log_in(const Logins& logins, const Request& request, RequestContext& context) {
  std::optional<std::string> token;
  if (request.count_headers("Authorization") == 1)
    token = bearer_of(request.header("Authorization"));
  if (token && logins.tokens != nullptr) {
    if (const auto caller = logins.tokens->find(*token)) {
      context.caller = *caller;
      return;
    }
  }
  if (token && logins.provider != nullptr && oidc::is_web_token(*token)) {
    const oidc::Login login = logins.provider->login_of(*token);
    context.caller = login.caller;
    context.login_ends = login.expires;
    return;
  }
  throw Error(ErrorCode::kUnauthorized, "this request needs a valid token");
}

void check_role(Role role, bool is_metrics) {
  const bool allowed = role == Role::kAdmin || (role == Role::kMonitor) == is_metrics;
  if (!allowed) {
    throw Error(ErrorCode::kForbidden, "a token with the role \"" + std::string(to_string(role)) +
                                           "\" does not allow this");
  }
}

}  // namespace

const std::string& owner_of(const Request& request) { return request.context.caller.name; }

store::Viewer viewer_of(const Request& request) {
  const Caller& caller = request.context.caller;
  return caller.role == Role::kAdmin ? store::Viewer() : store::Viewer(caller.name);
}

std::string party_of(const Request& request) {
  const std::string& owner = owner_of(request);
  return owner.empty() ? net::party_of(request.remote_address) : "owner " + owner;
}

void begin_request(const Logins& logins, Request& request, Response& response) {
  RequestContext& context = request.context;
  context.trace = continue_trace(request.header("traceparent"));
  response.set_header("X-Request-Id", context.trace.request_id());
  if (!logins.are_required()) return;
  context.caller = {"", Role::kUser};
  const bool is_metrics = request.path == "/metrics";
  // Browsers send preflight requests (OPTIONS) without the token.
  if (request.method == "OPTIONS" || (!is_metrics && !is_below(request.path, "/v1"))) return;
  try {
    log_in(logins, request, context);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kUnauthorized) {
      response.set_header("WWW-Authenticate", "Bearer realm=\"isomesh\"");
    }
    throw;
  }
  check_role(context.caller.role, is_metrics);
}

std::function<bool()> validity_of(
    const Logins& logins, const Request& request,
    const std::function<std::chrono::system_clock::time_point()>& now) {
  if (!logins.are_required()) return [] { return true; };
  // A login has been accepted; what is left to happen to it is that it ends.
  if (const auto ends = request.context.login_ends) return [now, ends] { return now() < *ends; };
  if (logins.tokens == nullptr) return [] { return false; };  // nobody is logged in
  std::string token = bearer_of(request.header("Authorization")).value_or("");
  return [tokens = logins.tokens, caller = request.context.caller, token = std::move(token),
          checked = std::uint64_t{0}]() mutable {
    const std::uint64_t loads = tokens->loads();
    if (checked == loads) return true;
    if (tokens->find(token) != caller) return false;
    checked = loads;
    return true;
  };
}

void end_request(Metrics& metrics, const Request& request, const Response& response,
                 const BodySizes& sizes) {
  const RequestContext& context = request.context;
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - context.began;
  metrics.count({.method = request.method,
                 .route = context.route,
                 .status = response.status,
                 .seconds = elapsed.count(),
                 .bytes_in = sizes.received,
                 .bytes_out = sizes.sent});
  LogLine line("request");
  line.add("id", context.trace.request_id())
      .add("method", request.method)
      .add("route", context.route)
      .add("status", response.status)
      .add("in", sizes.received)
      .add("out", sizes.sent)
      .add("ms", elapsed.count() * 1000);
  if (!context.caller.name.empty()) line.add("token", context.caller.name);
  line.add("remote", request.remote_address.empty() ? "unix" : request.remote_address);
}

}  // namespace isomesh::http
