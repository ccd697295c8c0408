// Handles a request from its guards to its route.
#pragma once

#include <atomic>
#include <functional>
#include <optional>

#include "server/http/app/services.h"
#include "server/http/connections/connections.h"
#include "server/http/guards/access.h"
#include "server/http/guards/origin.h"
#include "server/http/guards/read_trail.h"
#include "server/http/observe/readiness.h"
#include "server/http/requests/kept_uploads.h"
#include "server/http/requests/response.h"
#include "server/http/requests/router.h"
#include "server/http/responses/event_stream.h"
#include "server/net/fair_places.h"

namespace isomesh::http {

// State shared by all routes. Thread safe once the routes are added.
struct App {
  App(const Services& the_services, const ServerOptions& the_options);

  Services services;
  ServerOptions options;
  const Logins logins{services.tokens, services.provider};
  Metrics& metrics = services.metrics;
  net::FairPlaces uploads;
  KeptUploads kept;
  net::FairPlaces streams;
  Broadcaster events;
  OriginRules rules;  // constant once the server is bound
  RefusedOrigins refused_origins;
  const TrustedProxies proxies{options.trusted_proxies, options.proxy_header};
  ReadTrail reads{{services.audit, services.volumes, services.jobs}};
  // Earlier events belong to a previous process.
  const std::uint64_t first_event = services.jobs.last_event();
  std::atomic<bool> draining = false;  // finish running jobs, accept no new ones
  std::atomic<bool> stopping = false;  // end all waiting
  Router router;
  Readiness readiness;
  Connections connections;
};

// Passes a request through its guards to its route. Does not throw.
std::optional<Continuation> answer(App& app, Request& request, Response& response);

// Converts exceptions of `run` to a problem. Clients see the text of an Error only. While the data
// folder is missing, an internal error is answered with 503.
std::optional<Continuation> guarded(const store::DataFolder& folder, const Request& request,
                                    Response& response,
                                    const std::function<std::optional<Continuation>()>& run);

}  // namespace isomesh::http
