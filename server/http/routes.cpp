#include "server/http/routes.h"

#include <exception>
#include <new>

#include <spdlog/spdlog.h>

#include "proto/json.h"
#include "server/http/log.h"

namespace isomesh::http {
namespace {

constexpr const char* kRetryAfterSeconds = "1";

// Where what handlers throw ends; nothing of it reaches a client but an Error's own words.
template <class Run>
void guarded(const httplib::Request& request, httplib::Response& response, const Run& run) {
  try {
    run();
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kInternal) {
      spdlog::error("{} {}: {}", request.method, request.path, error.what());
    }
    answer_problem(request, response, error);
  } catch (const std::bad_alloc&) {
    spdlog::error("{} {}: out of memory", request.method, request.path);
    answer_problem(request, response,
                   Error(ErrorCode::kUnavailable, "there is not enough memory at the moment"));
  } catch (const std::exception& error) {
    spdlog::error("{} {}: {}", request.method, request.path, error.what());
    answer_problem(request, response, Error(ErrorCode::kInternal, error.what()));
  }
}

void add_methods(App& app, const std::string& pattern, const std::set<std::string>& methods) {
  Route& route = app.routes[pattern];
  route.path = std::regex(pattern);
  route.methods.insert(methods.begin(), methods.end());
  route.label = label_of(pattern);
}

}  // namespace

FrontOptions front_options(App& app) {
  FrontOptions front;
  front.threads = app.options.threads;
  front.backlog = app.options.backlog;
  front.doorman.head_time = app.options.request_time;
  if (const TlsFiles* tls = app.options.tls) {
    front.stream_of = [tls](int socket) { return tls->accept(socket); };
  }
  front.on_turned_away = [&app](const std::string& address, const Error& error) {
    const int status = describe(error.code()).status;
    app.metrics.count({.method = "", .route = kNoRoute, .status = status});
    LogLine("request")
        .add("status", status)
        .add("reason", error.what())
        .add("remote", address.empty() ? "unix" : address);
  };
  return front;
}

void add_get(App& app, const std::string& pattern, const Handler& handler) {
  add_methods(app, pattern, {"GET", "HEAD"});
  app.http.Get(pattern, [handler](const httplib::Request& request, httplib::Response& response) {
    guarded(request, response, [&] { handler(request, response); });
  });
}

void add_post(App& app, const std::string& pattern, const BodyHandler& handler) {
  add_methods(app, pattern, {"POST"});
  app.http.Post(pattern, [handler](const httplib::Request& request, httplib::Response& response,
                                   const httplib::ContentReader& read_body) {
    guarded(request, response, [&] { handler(request, response, read_body); });
  });
}

// With a content reader that is not called: the other overload waits for a body that a DELETE
// does not have.
void add_delete(App& app, const std::string& pattern, const Handler& handler) {
  add_methods(app, pattern, {"DELETE"});
  app.http.Delete(pattern, [handler](const httplib::Request& request, httplib::Response& response,
                                     const httplib::ContentReader& /*read_body*/) {
    guarded(request, response, [&] { handler(request, response); });
  });
}

std::string id_of(const httplib::Request& request) { return request.matches[1].str(); }

bool wait_for_end(const App& app, const Job& job, std::chrono::milliseconds wait) {
  Exchange& exchange = *Exchange::current();
  const bool has_waited =
      exchange.resumed() && std::chrono::steady_clock::now() >= exchange.resumed()->until;
  if (is_final(job.state) || wait.count() == 0 || has_waited || app.stopping) return false;
  exchange.park({job.id, std::chrono::steady_clock::now() + wait});
  return true;
}

void answer_json(httplib::Response& response, int status, const std::string& json) {
  response.status = status;
  response.set_header("Cache-Control", "no-store");
  response.set_content(json, "application/json");
}

std::string etag_of(const std::string& text) {
  constexpr std::size_t kEnough = 32;  // hex digits, of 64
  return '"' + store::sha256_of(text).substr(0, kEnough) + '"';
}

void answer_tagged_json(const httplib::Request& request, httplib::Response& response,
                        const std::string& json) {
  const std::string etag = etag_of(json);
  check_if_match(request, etag);
  response.set_header("ETag", etag);
  response.set_header("Cache-Control", "private, no-cache");  // ask each time
  if (matches_etag(request, etag)) {
    response.status = 304;
    return;
  }
  response.status = 200;
  response.set_content(json, "application/json");
}

Slots::Place place_for_upload(App& app) {
  if (app.draining) throw Error(ErrorCode::kUnavailable, "the service is shutting down");
  auto place = app.uploads.try_take();
  if (!place) throw Error(ErrorCode::kUnavailable, "too many uploads are under way");
  return std::move(*place);
}

Job submitted(App& app, const store::JobSpec& spec, httplib::Response& response) {
  const store::Submission submission = app.services.jobs.submit(spec);
  if (submission.kind == store::Submission::Kind::kBusy) {
    response.set_header("Retry-After", std::to_string(submission.retry_after.count()));
  }
  return store::job_of(submission);
}

void answer_problem(const httplib::Request& request, httplib::Response& response,
                    const Error& error) {
  const Problem problem = to_problem(error, request.path);
  response.status = problem.status;
  response.set_header("Cache-Control", "no-store");
  const bool may_come_again = problem.status == 429 || problem.status == 503;
  if (may_come_again && !response.has_header("Retry-After")) {
    response.set_header("Retry-After", kRetryAfterSeconds);
  }
  response.set_content(to_json(problem), "application/problem+json");
}

}  // namespace isomesh::http
