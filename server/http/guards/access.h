// What every request goes through before and after its route: the check of its token, its line of
// the log, its counters. Private to server/http.
#pragma once

#include <string>

#include "server/http/connections/connections.h"
#include "server/http/guards/auth.h"
#include "server/http/observe/metrics.h"
#include "server/http/requests/request.h"
#include "server/http/requests/response.h"
#include "server/store/job_store.h"

namespace isomesh::http {

// The owner of what this request makes; "" where no tokens are configured.
const std::string& owner_of(const Request& request);

// Whose things this request may see: its owner's, or everybody's for an administrator.
store::Viewer viewer_of(const Request& request);

// Who shares limits (net::FairPlaces) with this request: its owner, or its address where there are
// no tokens; "" for what comes through a Unix socket without them.
std::string party_of(const Request& request);

// Gives the request its trace, which X-Request-Id tells the client, and finds out who sends it.
// `tokens` is null where none are configured. To be called before the route is looked for. Throws
// Error kUnauthorized, and kForbidden when the caller's role does not allow the route.
void begin_request(const Tokens* tokens, Request& request, Response& response);

// Writes the request's line of the log and counts it.
void end_request(Metrics& metrics, const Request& request, const Response& response,
                 const BodySizes& sizes);

}  // namespace isomesh::http
