// How a request begins and ends, whatever its route: who asks, under which name it is logged, what
// it is counted as. Private to this folder.
#pragma once

#include <chrono>
#include <string>
#include <string_view>

#include <httplib.h>

#include "server/http/auth.h"
#include "server/http/metrics.h"
#include "server/http/trace.h"
#include "server/store/job_store.h"

namespace isomesh::http {

struct App;

// The request that this thread serves; a thread serves one after the other.
struct CurrentRequest {
  std::chrono::steady_clock::time_point began;
  Trace trace;
  Caller caller;
  std::string_view route = kNoRoute;  // lives as long as the server
};

// Thread safe: every thread has its own.
CurrentRequest& current_request();

// Whose what this request makes is; "" where no tokens are configured.
const std::string& owner();

// Whose things this request may see: its owner's, or everybody's for an administrator.
store::Viewer viewer();

// Names the request, in X-Request-Id too, and finds out who sends it. To be called before anything
// else looks at it. Throws Error kUnauthorized, and kForbidden when the caller's role does not
// reach that far.
void begin_request(const App& app, const httplib::Request& request, httplib::Response& response);

// Writes the request's line of the log and counts it, once its answer is sent.
void end_request(App& app, const httplib::Request& request, const httplib::Response& response);

// What a route's pattern is called in logs and metrics: /v1/jobs/{id}.
std::string label_of(const std::string& pattern);

}  // namespace isomesh::http
