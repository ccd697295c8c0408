// How routes are written and answered; private to this folder.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include <httplib.h>

#include "proto/error.h"
#include "proto/types.h"
#include "server/http/access.h"
#include "server/http/event_stream.h"
#include "server/http/front.h"
#include "server/http/origin.h"
#include "server/http/request.h"
#include "server/http/server.h"
#include "server/http/slots.h"
#include "server/store/database.h"

namespace isomesh::http {

struct Route {
  std::regex path;
  std::set<std::string> methods;
  std::string label;  // what it is called in logs and metrics
};

struct App;
FrontOptions front_options(App& app);

// What all routes share. Thread safe once the routes are added.
struct App {
  App(const Services& the_services, const ServerOptions& the_options)
      : services(the_services),
        options(the_options),
        uploads(the_options.upload_places),
        streams(the_options.event_streams),
        rules{.cors_origins = the_options.cors_origins,
              .check_host = false,
              .hosts = the_options.hosts},
        http(front_options(*this)) {}

  Services services;
  ServerOptions options;
  const Tokens* tokens = services.tokens;  // null: everybody may do everything
  Metrics& metrics = services.metrics;
  Slots uploads;
  Slots streams;  // of events
  Broadcaster events;
  OriginRules rules;  // constant once the server is bound
  const std::uint64_t began_us = static_cast<std::uint64_t>(store::now_us());
  std::atomic<bool> draining = false;  // running jobs are finished, others are not accepted
  std::atomic<bool> stopping = false;  // nobody is waited for any more
  Front http;
  std::map<std::string, Route> routes;  // by pattern
};

// A handler may throw: Error becomes its problem, anything else is logged and becomes kInternal.
using Handler = std::function<void(const httplib::Request&, httplib::Response&)>;
using BodyHandler =
    std::function<void(const httplib::Request&, httplib::Response&, const httplib::ContentReader&)>;

// Patterns are whole paths; only bounded repetitions, because std::regex recurses.
void add_get(App& app, const std::string& pattern, const Handler& handler);
void add_post(App& app, const std::string& pattern, const BodyHandler& handler);
void add_delete(App& app, const std::string& pattern, const Handler& handler);

inline const std::string kId = "([A-Za-z0-9-]{1,64})";

// The id that the pattern's first group matched.
std::string id_of(const httplib::Request& request);

void answer_json(httplib::Response& response, int status, const std::string& json);

// The entity tag of what is represented by that text.
std::string etag_of(const std::string& text);
// Answers 200, or 304 when the client has the same already. Throws Error kPreconditionFailed.
void answer_tagged_json(const httplib::Request& request, httplib::Response& response,
                        const std::string& json);
void answer_problem(const httplib::Request& request, httplib::Response& response,
                    const Error& error);

// Lists come in pages.
inline constexpr WholeNumbers kPageSizes = {1, 1000};
inline constexpr std::uint64_t kUsualPageSize = 100;

// Throws Error kUnavailable when all places are taken, or nothing is accepted any more.
Slots::Place place_for_upload(App& app);

// Submits a job. Throws what store::job_of throws, and then says in `response` when to come again.
Job submitted(App& app, const store::JobSpec& spec, httplib::Response& response);

// Has the request wait for the job's end, at most so long. False when there is nothing to wait for
// (any more), and its handler answers now; true when it returns now, and will run again.
bool wait_for_end(const App& app, const Job& job, std::chrono::milliseconds wait);

// Answers with a finished job's mesh file: entity tag, one range, timings.
void answer_mesh(const App& app, const httplib::Request& request, httplib::Response& response,
                 const Job& job, MeshFormat format);

void add_volume_routes(App& app);
void add_job_routes(App& app);
void add_mesh_routes(App& app);
void add_survey_routes(App& app);
void add_page_routes(App& app);
void add_service_routes(App& app);
void add_metrics_route(App& app);

}  // namespace isomesh::http
