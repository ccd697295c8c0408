#include "server/http/server.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <regex>

#include <arpa/inet.h>
#include <spdlog/spdlog.h>
#include <strings.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "server/http/routes.h"
#include "server/http/task_queue.h"

namespace isomesh::http {
namespace {

constexpr std::size_t kLongestPath = 256;
constexpr std::size_t kLongestTarget = 4096;
constexpr std::size_t kMostHeaders = 100;
constexpr std::chrono::seconds kReadTimeout{10};
constexpr std::chrono::seconds kWriteTimeout{10};

// Text that cannot forge a line of the log.
std::string printable(std::string text) {
  std::ranges::replace_if(
      text, [](unsigned char c) { return c < 0x20 || c == 0x7F; }, '?');
  return text;
}

// Two readings of where a body ends are how requests are smuggled past a proxy (RFC 9112, 6.3).
void check_framing(const httplib::Request& request) {
  const std::string length = request.get_header_value("Content-Length");
  const bool digits_only =
      std::ranges::all_of(length, [](unsigned char c) { return c >= '0' && c <= '9'; });
  if (request.get_header_value_count("Content-Length") > 1 || !digits_only) {
    throw invalid_parameter("Content-Length", "must be one whole number");
  }
  if (!request.has_header("Transfer-Encoding")) return;
  if (request.has_header("Content-Length") ||
      ::strcasecmp(request.get_header_value("Transfer-Encoding").c_str(), "chunked") != 0) {
    throw invalid_parameter("Transfer-Encoding",
                            "must be \"chunked\", and without a Content-Length");
  }
}

bool has_body_length(const httplib::Request& request) {
  return request.has_header("Content-Length") ||
         ::strcasecmp(request.get_header_value("Transfer-Encoding").c_str(), "chunked") == 0;
}

// What must be refused before the library looks for a route or reads a body. The reasons are in the
// library's own behaviour: its regular expressions recurse over long paths, it waits for bodies
// that have no length, and its handling of ranges reads beyond the content.
void check_request(httplib::Request& request) {
  request.ranges.clear();
  if (request.path.size() > kLongestPath || request.target.size() > kLongestTarget) {
    throw Error(ErrorCode::kUriTooLong, "the request's path or query is too long");
  }
  if (request.headers.size() > kMostHeaders) {
    throw Error(ErrorCode::kInvalidParameter, "the request has too many headers");
  }
  check_framing(request);
  const bool needs_body =
      request.method == "POST" || request.method == "PUT" || request.method == "PATCH";
  if (needs_body && !has_body_length(request)) {
    throw Error(ErrorCode::kLengthRequired, "the request needs a Content-Length");
  }
}

// A path that is known for other methods is not "not found".
Error unknown_route(const App& app, const httplib::Request& request, httplib::Response& response) {
  if (request.path.size() <= kLongestPath) {
    for (const auto& [pattern, methods] : app.methods) {
      if (methods.contains(request.method) ||
          !std::regex_match(request.path, std::regex(pattern))) {
        continue;
      }
      std::string allowed;
      for (const std::string& method : methods) allowed += (allowed.empty() ? "" : ", ") + method;
      response.set_header("Allow", allowed);
      return {ErrorCode::kMethodNotAllowed, "this resource knows " + allowed};
    }
  }
  return {ErrorCode::kNotFound, "there is nothing at this path"};
}

// Fills the answers that the library makes by itself.
void complete_error(const App& app, const httplib::Request& request, httplib::Response& response) {
  if (!response.body.empty()) return;
  switch (response.status) {
    case 404:
      return answer_problem(request, response, unknown_route(app, request, response));
    case 413:
      return answer_problem(request, response, {ErrorCode::kTooLarge, "the body is too large"});
    case 414:
      return answer_problem(request, response, {ErrorCode::kUriTooLong, "the target is too long"});
    case 416:
      return answer_problem(request, response,
                            {ErrorCode::kRangeNotSatisfiable, "the range is malformed"});
    case 500:
      return answer_problem(request, response, {ErrorCode::kInternal, ""});
    default:
      return answer_problem(request, response,
                            {ErrorCode::kInvalidParameter, "the request is malformed"});
  }
}

void configure(App& app) {
  httplib::Server& http = app.http;
  http.new_task_queue = [&app] {
    return new BoundedTaskQueue(app.options.threads, app.options.backlog);
  };
  // The default lets a second daemon bind the same port and take half of the connections.
  http.set_socket_options([&app](socket_t socket) {
    const int yes = 1;
    ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    app.listening = socket;
  });
  http.set_tcp_nodelay(true);
  http.set_read_timeout(kReadTimeout);
  http.set_write_timeout(kWriteTimeout);
  // One request a connection: the body of a refused one would be read as the next request.
  http.set_keep_alive_max_count(1);
  http.set_payload_max_length(app.options.upload.max_bytes);
  http.set_default_headers({{"X-Content-Type-Options", "nosniff"}});
  http.set_pre_routing_handler(
      [&app](const httplib::Request& request, httplib::Response& response) {
        try {
          begin_request(app, request, response);
          // The library hands its own request over as constant; the guard has to clear its ranges.
          check_request(const_cast<httplib::Request&>(request));
          return httplib::Server::HandlerResponse::Unhandled;
        } catch (const Error& error) {
          answer_problem(request, response, error);
          return httplib::Server::HandlerResponse::Handled;
        }
      });
  http.set_error_handler([&app](const httplib::Request& request, httplib::Response& response) {
    complete_error(app, request, response);
  });
  http.set_exception_handler(
      [](const httplib::Request& request, httplib::Response& response, const std::exception_ptr&) {
        spdlog::error("{}: an exception left its route", printable(request.path));
        answer_problem(request, response, {ErrorCode::kInternal, ""});
      });
  http.set_logger([&app](const httplib::Request& request, const httplib::Response& response) {
    end_request(app, request, response);
  });
}

// The library lets five connections wait to be accepted; the next ones in a burst would be dropped,
// and try again a second later.
void widen_backlog(const App& app) { ::listen(app.listening, SOMAXCONN); }

}  // namespace

bool Address::is_loopback() const {
  if (is_unix() || host == "localhost" || host == "::1") return true;
  in_addr v4 = {};
  constexpr std::uint32_t kLoopbackNetwork = 127;
  return ::inet_pton(AF_INET, host.c_str(), &v4) == 1 && ntohl(v4.s_addr) >> 24 == kLoopbackNetwork;
}

Address parse_address(const std::string& text) {
  constexpr std::string_view kUnix = "unix:";
  if (text.starts_with(kUnix)) {
    const std::string path = text.substr(kUnix.size());
    constexpr std::size_t kLongestSocketPath = 107;  // what sockaddr_un holds
    if (path.empty() || path.size() > kLongestSocketPath) {
      throw invalid_parameter("listen", "a socket's path has 1 to 107 bytes");
    }
    return {.host = "", .port = 0, .unix_path = path};
  }
  const std::size_t colon = text.rfind(':');
  std::string host = text.substr(0, std::min(colon, text.size()));
  const std::string port = colon == std::string::npos ? "" : text.substr(colon + 1);
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  unsigned number = 0;
  const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), number);
  if (host.empty() || error != std::errc() || end != port.data() + port.size() || number > 65535) {
    throw invalid_parameter("listen", "must be HOST:PORT or unix:PATH");
  }
  return {.host = host, .port = static_cast<int>(number), .unix_path = {}};
}

struct Server::State {
  State(const Services& services, const ServerOptions& options) : app(services, options) {}

  App app;
  Address address;
};

Server::Server(const Services& services, const ServerOptions& options)
    : state_(std::make_unique<State>(services, options)) {
  configure(state_->app);
  add_volume_routes(state_->app);
  add_job_routes(state_->app);
  add_mesh_routes(state_->app);
  add_survey_routes(state_->app);
  add_page_routes(state_->app);
  add_service_routes(state_->app);
}

Server::~Server() {
  if (!state_->address.is_unix()) return;
  std::error_code ignored;  // the next start removes it too
  std::filesystem::remove(state_->address.unix_path, ignored);
}

std::string Server::bind(const Address& address) {
  httplib::Server& http = state_->app.http;
  const Error cannot(ErrorCode::kUnavailable, "cannot listen there: is the address in use?");
  if (address.is_unix()) {
    // A socket that a killed daemon left behind; the data folder's lock tells that it is dead.
    std::error_code error;
    if (std::filesystem::is_socket(address.unix_path, error)) {
      std::filesystem::remove(address.unix_path, error);
    }
    http.set_address_family(AF_UNIX);
    constexpr int kUnusedPort = 80;
    if (!http.bind_to_port(address.unix_path, kUnusedPort)) throw cannot;
    state_->address = address;
    widen_backlog(state_->app);
    // For a reverse proxy in the same group.
    ::chmod(address.unix_path.c_str(), 0660);
    return "unix:" + address.unix_path.string();
  }
  const int port = address.port == 0
                       ? http.bind_to_any_port(address.host)
                       : (http.bind_to_port(address.host, address.port) ? address.port : -1);
  if (port < 0) throw cannot;
  widen_backlog(state_->app);
  const bool is_v6 = address.host.find(':') != std::string::npos;
  return "http://" + (is_v6 ? '[' + address.host + ']' : address.host) + ':' + std::to_string(port);
}

void Server::serve() { state_->app.http.listen_after_bind(); }

Metrics& Server::metrics() { return state_->app.metrics; }

void Server::begin_drain() {
  state_->app.draining = true;
  state_->app.services.jobs.refuse_new();
}

void Server::stop() {
  state_->app.stopping = true;
  state_->app.services.estimator.stop();
  state_->app.services.library.stop_imports();
  state_->app.services.jobs.close();
  state_->app.http.stop();
}

}  // namespace isomesh::http
