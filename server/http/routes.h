// How routes are written and answered; private to this folder.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include <httplib.h>

#include "proto/error.h"
#include "proto/types.h"
#include "server/http/access.h"
#include "server/http/server.h"
#include "server/http/slots.h"

namespace isomesh::http {

// What all routes share. Thread safe once the routes are added.
struct App {
  App(const Services& the_services, const ServerOptions& the_options)
      : services(the_services),
        options(the_options),
        uploads(the_options.upload_places),
        waits(the_options.wait_places) {}

  Services services;
  ServerOptions options;
  const Tokens* tokens = services.tokens;  // null: everybody may do everything
  Metrics metrics;
  Slots uploads;
  Slots waits;
  std::atomic<bool> draining = false;  // running jobs are finished, others are not accepted
  std::atomic<bool> stopping = false;  // nobody is waited for any more
  httplib::Server http;
  socket_t listening = -1;  // the socket that `http` accepts from, once bound
  std::map<std::string, std::set<std::string>> methods;  // of each route's pattern
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
void answer_problem(const httplib::Request& request, httplib::Response& response,
                    const Error& error);

// Answers with a finished job's mesh file: entity tag, one range, timings.
void answer_mesh(const App& app, const httplib::Request& request, httplib::Response& response,
                 const Job& job, MeshFormat format);

void add_volume_routes(App& app);
void add_job_routes(App& app);
void add_mesh_routes(App& app);
void add_survey_routes(App& app);
void add_page_routes(App& app);
void add_service_routes(App& app);

}  // namespace isomesh::http
