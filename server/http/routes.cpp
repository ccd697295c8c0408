#include "server/http/routes.h"

#include <exception>
#include <new>

#include <spdlog/spdlog.h>

#include "proto/json.h"

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

}  // namespace

void add_get(App& app, const std::string& pattern, const Handler& handler) {
  app.methods[pattern].insert({"GET", "HEAD"});
  app.http.Get(pattern, [handler, label = label_of(pattern)](const httplib::Request& request,
                                                             httplib::Response& response) {
    current_request().route = label;
    guarded(request, response, [&] { handler(request, response); });
  });
}

void add_post(App& app, const std::string& pattern, const BodyHandler& handler) {
  app.methods[pattern].insert("POST");
  app.http.Post(pattern, [handler, label = label_of(pattern)](
                             const httplib::Request& request, httplib::Response& response,
                             const httplib::ContentReader& read_body) {
    current_request().route = label;
    guarded(request, response, [&] { handler(request, response, read_body); });
  });
}

// With a content reader that is not called: the other overload waits for a body that a DELETE
// does not have.
void add_delete(App& app, const std::string& pattern, const Handler& handler) {
  app.methods[pattern].insert("DELETE");
  app.http.Delete(pattern, [handler, label = label_of(pattern)](
                               const httplib::Request& request, httplib::Response& response,
                               const httplib::ContentReader& /*read_body*/) {
    current_request().route = label;
    guarded(request, response, [&] { handler(request, response); });
  });
}

std::string id_of(const httplib::Request& request) { return request.matches[1].str(); }

void answer_json(httplib::Response& response, int status, const std::string& json) {
  response.status = status;
  response.set_header("Cache-Control", "no-store");
  response.set_content(json, "application/json");
}

void answer_problem(const httplib::Request& request, httplib::Response& response,
                    const Error& error) {
  const Problem problem = to_problem(error, request.path);
  response.status = problem.status;
  response.set_header("Cache-Control", "no-store");
  if (problem.status == 429 || problem.status == 503) {
    response.set_header("Retry-After", kRetryAfterSeconds);
  }
  response.set_content(to_json(problem), "application/problem+json");
}

}  // namespace isomesh::http
