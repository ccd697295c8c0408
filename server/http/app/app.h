// What requests are answered with, and the way of each from its guards to its route.
#pragma once

#include <atomic>
#include <functional>
#include <optional>

#include "server/http/answers/event_stream.h"
#include "server/http/app/services.h"
#include "server/http/connections/connections.h"
#include "server/http/guards/access.h"
#include "server/http/guards/origin.h"
#include "server/http/observe/readiness.h"
#include "server/http/requests/kept_uploads.h"
#include "server/http/requests/response.h"
#include "server/http/requests/router.h"
#include "server/net/fair_places.h"

namespace isomesh::http {

// What all routes share. Thread safe once the routes are added.
struct App {
  App(const Services& the_services, const ServerOptions& the_options);

  Services services;
  ServerOptions options;
  const Tokens* tokens = services.tokens;  // null: everybody may do everything
  Metrics& metrics = services.metrics;
  net::FairPlaces uploads;
  KeptUploads kept;
  net::FairPlaces streams;  // of events
  Broadcaster events;
  OriginRules rules;  // constant once the server is bound
  // What came before was told by another life.
  const std::uint64_t first_event = services.jobs.last_event();
  std::atomic<bool> draining = false;  // running jobs are finished, others are not accepted
  std::atomic<bool> stopping = false;  // nobody is waited for any more
  Router router;
  Readiness readiness;
  Connections connections;
};

// One request from its guards to its route. Does not throw.
std::optional<Continuation> answer(App& app, Request& request, Response& response);

// Makes a problem of what `run` throws. Only an Error's own words reach a client.
std::optional<Continuation> guarded(const Request& request, Response& response,
                                    const std::function<std::optional<Continuation>()>& run);

}  // namespace isomesh::http
