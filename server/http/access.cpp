#include "server/http/access.h"

#include <array>
#include <optional>

#include "server/http/log.h"
#include "server/http/routes.h"

namespace isomesh::http {
namespace {

bool is_below(std::string_view path, std::string_view folder) {
  return path == folder || (path.starts_with(folder) && path[folder.size()] == '/');
}

// One answer for all that is not a known token, so that it teaches nothing.
Caller caller_of(const Tokens& tokens, const httplib::Request& request) {
  std::optional<Caller> caller;
  if (request.get_header_value_count("Authorization") == 1) {
    const auto token = bearer_of(request.get_header_value("Authorization"));
    if (token) caller = tokens.find(*token);
  }
  if (!caller) throw Error(ErrorCode::kUnauthorized, "this needs a token that the server knows");
  return *caller;
}

void check_role(Role role, bool is_metrics) {
  const bool allowed = role == Role::kAdmin || (role == Role::kMonitor) == is_metrics;
  if (!allowed) {
    throw Error(ErrorCode::kForbidden,
                "a token of the role \"" + std::string(to_string(role)) + "\" does not allow this");
  }
}

std::uint64_t length_of(const httplib::Response& response) {
  return response.body.empty() ? response.content_length_ : response.body.size();
}

void replace_all(std::string& text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at)) {
    text.replace(at, from.size(), to);
    at += to.size();
  }
}

}  // namespace

CurrentRequest& current_request() {
  thread_local CurrentRequest request;
  return request;
}

const std::string& owner() { return current_request().caller.name; }

store::Viewer viewer() {
  const Caller& caller = current_request().caller;
  return caller.role == Role::kAdmin ? store::Viewer() : store::Viewer(caller.name);
}

void begin_request(const App& app, const httplib::Request& request, httplib::Response& response) {
  CurrentRequest& current = current_request();
  current = {};
  current.began = Exchange::current()->began();
  current.trace = continue_trace(request.get_header_value("traceparent"));
  response.set_header("X-Request-Id", current.trace.request_id());
  if (app.tokens == nullptr) return;
  current.caller = {"", Role::kUser};
  const bool is_metrics = request.path == "/metrics";
  // A browser asks what it may do before it sends the token.
  if (request.method == "OPTIONS" || (!is_metrics && !is_below(request.path, "/v1"))) return;
  try {
    current.caller = caller_of(*app.tokens, request);
  } catch (const Error&) {
    response.set_header("WWW-Authenticate", "Bearer realm=\"isomesh\"");
    throw;
  }
  check_role(current.caller.role, is_metrics);
}

void end_request(App& app, const httplib::Request& request, const httplib::Response& response) {
  if (Exchange::current()->parking()) return;  // it is answered later
  const CurrentRequest& current = current_request();
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - current.began;
  const std::uint64_t bytes_in = Exchange::current()->received();
  const std::uint64_t bytes_out = request.method == "HEAD" ? 0 : length_of(response);
  app.metrics.count({.method = request.method,
                     .route = current.route,
                     .status = response.status,
                     .seconds = elapsed.count(),
                     .bytes_in = bytes_in,
                     .bytes_out = bytes_out});
  LogLine line("request");
  line.add("id", current.trace.request_id())
      .add("method", request.method)
      .add("route", current.route)
      .add("status", response.status)
      .add("in", bytes_in)
      .add("out", bytes_out)
      .add("ms", elapsed.count() * 1000);
  if (!current.caller.name.empty()) line.add("token", current.caller.name);
  line.add("remote", request.remote_addr.empty() ? "unix" : request.remote_addr);
}

std::string label_of(const std::string& pattern) {
  std::string label = pattern;
  replace_all(label, kId, "{id}");
  replace_all(label, "([a-z]{3})", "{format}");
  replace_all(label, "\\.", ".");
  return label;
}

}  // namespace isomesh::http
