#include "server/http/server.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <regex>
#include <thread>

#include <arpa/inet.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "server/http/records.h"
#include "server/http/routes.h"

namespace isomesh::http {
namespace {

constexpr std::size_t kLongestPath = 256;
constexpr std::size_t kLongestTarget = 4096;
constexpr std::chrono::seconds kLongestWatch{1};
// How long answers may still be sent when the service ends.
constexpr std::chrono::seconds kLastAnswers{5};

// Text that cannot forge a line of the log.
std::string printable(std::string text) {
  std::ranges::replace_if(
      text, [](unsigned char c) { return c < 0x20 || c == 0x7F; }, '?');
  return text;
}

// What must be refused before the library looks for a route or reads a body: its regular
// expressions recurse over long paths, and it waits for bodies that have no length.
void check_request(const httplib::Request& request) {
  if (request.path.size() > kLongestPath || request.target.size() > kLongestTarget) {
    throw Error(ErrorCode::kUriTooLong, "the request's path or query is too long");
  }
  const bool needs_body =
      request.method == "POST" || request.method == "PUT" || request.method == "PATCH";
  const bool has_length =
      request.has_header("Content-Length") || request.has_header("Transfer-Encoding");
  if (needs_body && !has_length) {
    throw Error(ErrorCode::kLengthRequired, "the request needs a Content-Length");
  }
}

// The methods of the route at that path, with commas between. Throws Error kNotFound.
std::string methods_at(const App& app, const std::string& path) {
  for (const auto& [pattern, route] : app.routes) {
    if (!std::regex_match(path, route.path)) continue;
    current_request().route = route.label;
    std::string all;
    for (const std::string& method : route.methods) all += (all.empty() ? "" : ", ") + method;
    return all;
  }
  throw Error(ErrorCode::kNotFound, "there is nothing at this path");
}

// Refuses what no route takes, so that the library reads no body for it. A path that is known for
// other methods is not "not found".
void check_route(const App& app, const httplib::Request& request, httplib::Response& response) {
  const std::string methods = methods_at(app, request.path);
  if ((", " + methods + ',').find(", " + request.method + ',') != std::string::npos) return;
  response.set_header("Allow", methods);
  throw Error(ErrorCode::kMethodNotAllowed, "this resource knows " + methods);
}

// Fills the answers that the library makes by itself.
void complete_error(const httplib::Request& request, httplib::Response& response) {
  if (!response.body.empty()) return;
  switch (response.status) {
    case 413:
      return answer_problem(request, response, {ErrorCode::kTooLarge, "the body is too large"});
    case 500:
      return answer_problem(request, response, {ErrorCode::kInternal, ""});
    default:
      return answer_problem(request, response,
                            {ErrorCode::kInvalidParameter, "the request is malformed"});
  }
}

void configure(App& app) {
  httplib::Server& http = app.http;
  // The default lets a second daemon bind the same port and take half of the connections.
  http.set_socket_options([](socket_t socket) {
    const int yes = 1;
    ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  });
  http.set_tcp_nodelay(true);
  http.set_payload_max_length(app.options.upload.max_bytes);
  http.set_default_headers({{"X-Content-Type-Options", "nosniff"}});
  http.set_pre_routing_handler(
      [&app](const httplib::Request& request, httplib::Response& response) {
        try {
          allow_reading(app.rules, request, response);
          check_origin(app.rules, request);
          begin_request(app, request, response);
          check_request(request);
          if (is_preflight(app.rules, request)) {
            answer_preflight(methods_at(app, request.path), response);
            return httplib::Server::HandlerResponse::Handled;
          }
          check_route(app, request, response);
          return httplib::Server::HandlerResponse::Unhandled;
        } catch (const Error& error) {
          answer_problem(request, response, error);
          return httplib::Server::HandlerResponse::Handled;
        }
      });
  http.set_error_handler([](const httplib::Request& request, httplib::Response& response) {
    complete_error(request, response);
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

bool has_ended(const App& app, const std::string& job) {
  try {
    return is_final(app.services.jobs.get(std::nullopt, job).state);
  } catch (const Error&) {
    return true;  // it is not there any more
  }
}

// Tells those who wait what happens to jobs, until the service stops.
void watch_jobs(App& app) {
  // What ended before this process began was told by another.
  std::uint64_t last = app.began_us;
  while (!app.stopping) {
    try {
      const auto events = app.services.jobs.events(std::nullopt, "", last, kLongestWatch);
      bool is_heard = false;
      for (const store::Event& event : events) {
        last = event.id;
        is_heard |= app.events.publish(event);
        if (event.kind != store::EventKind::kDone) continue;
        app.http.job_ended(event.job);
        record_ended(app, event.job);
      }
      if (is_heard) app.http.something_happened();
    } catch (const Error& error) {
      spdlog::error("events of jobs cannot be read: {}", error.what());
      std::this_thread::sleep_for(kLongestWatch);
    }
  }
}

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
  std::atomic<bool> is_over = false;
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
  add_metrics_route(state_->app);
}

Server::~Server() {
  if (!state_->address.is_unix()) return;
  std::error_code ignored;  // the next start removes it too
  std::filesystem::remove(state_->address.unix_path, ignored);
}

std::string Server::bind(const Address& address) {
  OriginRules& rules = state_->app.rules;
  rules.check_host = address.is_loopback() && !address.is_unix() && state_->app.tokens == nullptr;
  rules.hosts.push_back(address.host);
  for (std::string& host : rules.hosts) host = host_of(host);
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
    // For a reverse proxy in the same group.
    ::chmod(address.unix_path.c_str(), 0660);
    return "unix:" + address.unix_path.string();
  }
  const int port = address.port == 0
                       ? http.bind_to_any_port(address.host)
                       : (http.bind_to_port(address.host, address.port) ? address.port : -1);
  if (port < 0) throw cannot;
  const std::string scheme = state_->app.options.tls == nullptr ? "http://" : "https://";
  const bool is_v6 = address.host.find(':') != std::string::npos;
  return scheme + (is_v6 ? '[' + address.host + ']' : address.host) + ':' + std::to_string(port);
}

void Server::serve() {
  App& app = state_->app;
  app.http.open([&app](const std::string& job) { return has_ended(app, job); });
  {
    const std::jthread watching([&app] { watch_jobs(app); });
    state_->is_over.wait(false);
  }
  app.http.close(kLastAnswers);
}

void Server::begin_drain() {
  state_->app.draining = true;
  state_->app.services.jobs.refuse_new();
}

void Server::stop() {
  state_->app.stopping = true;
  state_->app.services.estimator.stop();
  state_->app.services.library.stop_imports();
  state_->app.services.jobs.close();
  state_->is_over = true;
  state_->is_over.notify_all();
}

}  // namespace isomesh::http
