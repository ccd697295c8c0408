// Checks before and after each route: authentication, the request's log line, its counters. Private
// to server/http.
#pragma once

#include <chrono>
#include <functional>
#include <string>

#include "server/http/connections/connections.h"
#include "server/http/guards/tokens.h"
#include "server/http/observe/metrics.h"
#include "server/http/oidc/provider.h"
#include "server/http/requests/request.h"
#include "server/http/requests/response.h"
#include "server/store/job_store.h"

namespace isomesh::http {

// The owner of this request's results; "" without tokens.
const std::string& owner_of(const Request& request);

// The request's view of volumes and jobs: its owner's, or all for an administrator.
store::Viewer viewer_of(const Request& request);

// The party that shares limits (net::FairPlaces) with this request: its owner, or its address
// without tokens; "" for a Unix socket without tokens.
std::string party_of(const Request& request);

// The ways to authenticate, which are used beside each other. Without any, nobody needs to.
struct Logins {
  const Tokens* tokens = nullptr;            // null: none are configured
  const oidc::Provider* provider = nullptr;  // null: none is configured

  bool are_required() const { return tokens != nullptr || provider != nullptr; }
};

// Assigns the request's trace, returned as X-Request-Id, and authenticates it. Call before routing.
// Throws Error kUnauthorized, kForbidden if the caller's role does not permit the route, and
// kUnavailable as the provider does.
void begin_request(const Logins& logins, Request& request, Response& response);

// A check of whether the token of a request that has begun is still valid, for responses that last.
// Always true without logins. It must not outlive them.
std::function<bool()> validity_of(const Logins& logins, const Request& request,
                                  const std::function<std::chrono::system_clock::time_point()>&
                                      now = std::chrono::system_clock::now);

void end_request(Metrics& metrics, const Request& request, const Response& response,
                 const BodySizes& sizes);

}  // namespace isomesh::http
