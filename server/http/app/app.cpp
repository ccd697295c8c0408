#include "server/http/app/app.h"

#include <exception>
#include <new>
#include <string_view>
#include <utility>

#include "base/log.h"
#include "proto/error.h"
#include "server/http/limits.h"
#include "server/http/observe/metrics.h"

namespace isomesh::http {
namespace {

ConnectionOptions connection_options(const ServerOptions& options) {
  ConnectionOptions connections;
  connections.connections = options.connections;
  connections.threads = options.threads;
  connections.backlog = options.backlog;
  connections.probes = {"/livez", "/readyz"};
  connections.acceptor.head_time = options.request_time;
  if (const net::TlsFiles* tls = options.tls) {
    connections.stream_of = [tls](int socket) { return tls->accept(socket); };
  }
  return connections;
}

KeptLimits kept_limits(const Services& services, const ServerOptions& options) {
  KeptLimits limits;
  limits.part_bytes =
      options.part_bytes > 0 ? options.part_bytes : services.folder.reserve().capacity() / 4;
  return limits;
}

void report_refused(Metrics& metrics, const std::string& address, const Error& error) {
  const int status = describe(error.code()).status;
  metrics.count({.method = "", .route = kNoRoute, .status = status});
  LogLine("request")
      .add("status", status)
      .add("reason", error.what())
      .add("remote", address.empty() ? "unix" : address);
}

// Requests wait for jobs, and for what wings make of them.
bool has_ended(const Services& services, const std::string& id) {
  if (services.wing != nullptr) {
    if (const auto ended = services.wing->has_ended(id)) return *ended;
  }
  try {
    return is_final(services.jobs.get(std::nullopt, id).state);
  } catch (const Error&) {
    return true;  // it was deleted
  }
}

// The reason why the service accepts no work; empty if it does. Jobs that wait for disk space are
// no reason: smaller jobs and uploads still fit, and every daemon of a cluster sees the same jobs.
std::string unready_reason(const Services& services) {
  if (!services.jobs.responds()) return "the database does not respond";
  if (!services.folder.responds()) return "the data folder is missing or cannot be written to";
  if (services.jobs.is_full()) return "the queue is full";
  if (!services.blobs.responds()) return "the storage of volumes and meshes does not respond";
  return services.blobs.has_room() ? "" : "the disk is full: nothing new is accepted";
}

// Rejects requests that are malformed for every route.
void check_request(const Request& request) {
  if (request.path.size() > limits::kLongestPath ||
      request.target.size() > limits::kLongestTarget) {
    throw Error(ErrorCode::kUriTooLong, "the request's path or query is too long");
  }
}

// Finds the route of the request's path and sets the request's path parameters. Throws Error
// kNotFound.
const Route& route_of(const Router& router, Request& request) {
  auto [route, parameters] = router.find(request.path);
  if (route == nullptr) throw Error(ErrorCode::kNotFound, "there is nothing at this path");
  request.context.route = route->pattern();
  request.path_parameters = std::move(parameters);
  return *route;
}

// Throws Error kMethodNotAllowed, with the allowed methods in the response.
const Handler& handler_of_method(const Route& route, const Request& request, Response& response) {
  const auto found = route.handlers().find(request.method);
  if (found != route.handlers().end()) return found->second;
  response.set_header("Allow", route.methods());
  throw Error(ErrorCode::kMethodNotAllowed, "this resource supports " + route.methods());
}

std::optional<Continuation> checked_answer(App& app, Request& request, Response& response) {
  allow_reading(app.rules, request, response);
  if (is_of_foreign_page(app.rules, request)) app.refused_origins.tell(request.header("Origin"));
  check_origin(app.rules, request);
  begin_request(app.logins, request, response);
  check_request(request);
  const Route& route = route_of(app.router, request);
  if (is_preflight(app.rules, request)) {
    answer_preflight(route.methods(), response);
    return std::nullopt;
  }
  return handler_of_method(route, request, response)(request, response);
}

// Reports a failure that is no client's fault. While the data folder is missing, it is not the
// service's either.
void answer_failure(const store::DataFolder& folder, const Request& request, Response& response,
                    const Error& error) {
  log_error("{} {} failed ({}): {}", request.method, request.context.route,
            request.context.trace.request_id(), error.what());
  answer_problem(request, response, folder.works() ? error : store::missing_folder());
}

}  // namespace

App::App(const Services& the_services, const ServerOptions& the_options)
    : services(the_services),
      options(the_options),
      uploads(the_options.upload_places, "uploads"),
      kept(kept_limits(the_services, the_options), the_services.folder.uploads()),
      streams(the_options.event_streams, "event streams"),
      rules{.cors_origins = the_options.cors_origins,
            .check_host = false,
            .hosts = the_options.hosts},
      readiness([&used = services] { return unready_reason(used); }),
      connections(
          connection_options(the_options),
          {.handle = [this](Request& request,
                            Response& response) { return answer(*this, request, response); },
           .has_ended = [this](const std::string& job) { return has_ended(services, job); },
           .on_answered =
               [this](const Request& request, const Response& response, const BodySizes& sizes) {
                 reads.note(request, response);
                 end_request(metrics, request, response, sizes);
               },
           .on_refused = [this](const std::string& address,
                                const Error& error) { report_refused(metrics, address, error); }}) {
}

std::optional<Continuation> guarded(const store::DataFolder& folder, const Request& request,
                                    Response& response,
                                    const std::function<std::optional<Continuation>()>& run) {
  try {
    return run();
  } catch (const RecordedProblem& recorded) {
    answer_problem(request, response, recorded.problem());
  } catch (const Error& error) {
    error.code() == ErrorCode::kInternal ? answer_failure(folder, request, response, error)
                                         : answer_problem(request, response, error);
  } catch (const std::bad_alloc&) {
    log_error("{} {} failed: out of memory", request.method, request.context.route);
    answer_problem(request, response,
                   Error(ErrorCode::kUnavailable, "the service is out of memory at the moment"));
  } catch (const std::exception& error) {
    answer_failure(folder, request, response, Error(ErrorCode::kInternal, error.what()));
  }
  return std::nullopt;
}

std::optional<Continuation> answer(App& app, Request& request, Response& response) {
  const store::DataFolder& folder = app.services.folder;
  request.remote_address = app.proxies.client_of(request);
  auto continuation =
      guarded(folder, request, response, [&] { return checked_answer(app, request, response); });
  if (!continuation) return std::nullopt;
  if (continuation->abandoned) {
    continuation->abandoned = [&folder,
                               run = std::move(continuation->abandoned)](const Request& asked) {
      Response nobodys;
      guarded(folder, asked, nobodys, [&] {
        run(asked);
        return std::optional<Continuation>();
      });
    };
  }
  continuation->resume = [&folder, resume = std::move(continuation->resume)](const Request& asked,
                                                                             Response& out) {
    guarded(folder, asked, out, [&] {
      resume(asked, out);
      return std::optional<Continuation>();
    });
  };
  return continuation;
}

}  // namespace isomesh::http
