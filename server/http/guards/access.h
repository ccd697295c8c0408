// Checks before and after each route: authentication, the request's log line, its counters. Private
// to server/http.
#pragma once

#include <functional>
#include <string>

#include "server/http/connections/connections.h"
#include "server/http/guards/tokens.h"
#include "server/http/observe/metrics.h"
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

// Assigns the request's trace, returned as X-Request-Id, and authenticates it. `tokens` is null if
// none are configured. Call before routing. Throws Error kUnauthorized, and kForbidden if the
// caller's role does not permit the route.
void begin_request(const Tokens* tokens, Request& request, Response& response);

// A check of whether the request's token is still valid, for responses that last. Always true if
// `tokens` is null. It must not outlive `tokens`.
std::function<bool()> validity_of(const Tokens* tokens, const Request& request);

void end_request(Metrics& metrics, const Request& request, const Response& response,
                 const BodySizes& sizes);

}  // namespace isomesh::http
