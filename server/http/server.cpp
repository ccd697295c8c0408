#include "server/http/server.h"

#include <chrono>
#include <exception>
#include <optional>
#include <thread>
#include <utility>

#include "base/log.h"
#include "server/http/app/outcomes.h"
#include "server/http/limits.h"
#include "server/http/routes/routes.h"
#include "server/net/listener.h"

namespace isomesh::http {
namespace {

// Distributes events of jobs to waiting requests, streams, the log and the metrics, until the
// service stops and all have been distributed.
void watch_jobs(App& app) {
  std::uint64_t last = app.first_event;
  while (true) {
    const bool is_ending = app.stopping;
    try {
      const auto events =
          app.services.jobs.events(std::nullopt, "", last, limits::kBetweenEventReads);
      bool is_heard = false;
      for (const store::Event& event : events) {
        last = event.id;
        is_heard |= app.events.publish(event);
        if (event.kind != store::EventKind::kDone) continue;
        app.connections.job_ended(event.job);
        if (app.services.wing != nullptr) app.services.wing->job_ended(event.job);
        if (!event.is_elsewhere) report_ended(app, event.job);
      }
      if (is_heard) app.connections.wake_sources();
      if (is_ending && events.empty()) return;
    } catch (const std::exception& error) {
      if (is_ending) return log_error("the last job events cannot be read: {}", error.what());
      log_error("job events cannot be read and are retried: {}", error.what());
      std::this_thread::sleep_for(limits::kBetweenEventReads);
    }
  }
}

}  // namespace

struct Server::State {
  State(const Services& services, const ServerOptions& options) : app(services, options) {}

  App app;
  std::optional<net::Listener> listener;
  std::jthread watching;
};

Server::Server(const Services& services, const ServerOptions& options)
    : state_(std::make_unique<State>(services, options)) {
  add_volume_routes(state_->app);
  add_upload_routes(state_->app);
  add_job_routes(state_->app);
  add_mesh_routes(state_->app);
  add_inspect_routes(state_->app);
  add_page_routes(state_->app);
  add_service_routes(state_->app);
  if (services.wing != nullptr) services.wing->add_routes(state_->app);
  services.metrics.expect("", kNoRoute);
  for (const Route& route : state_->app.router.routes()) {
    for (const auto& [method, handler] : route.handlers()) {
      services.metrics.expect(method, route.pattern());
      services.metrics.expect(method, kNoRoute);
    }
  }
}

Server::~Server() {
  // Its threads tell the app of ended orders, also if a start fails after start().
  if (Wing* const wing = state_->app.services.wing) wing->stop();
  if (state_->watching.joinable()) stop();
}

std::string Server::bind(const net::Address& address) {
  OriginRules& rules = state_->app.rules;
  const bool is_local = address.is_loopback() && !address.is_unix();
  rules.check_host = !state_->app.logins.are_required() && (is_local || !rules.hosts.empty());
  rules.hosts.push_back(address.host);
  for (std::string& host : rules.hosts) host = host_named(host);
  const std::string authority = state_->listener.emplace(address).authority();
  if (address.is_unix()) return authority;
  return (state_->app.options.tls == nullptr ? "http://" : "https://") + authority;
}

void Server::start() {
  App& app = state_->app;
  app.connections.open(state_->listener->descriptor());
  if (app.services.wing != nullptr) {
    app.services.wing->on_end([&app](const std::string& order) {
      app.connections.job_ended(order);
      app.services.callbacks.wake();
    });
  }
  state_->watching = std::jthread([&app] { watch_jobs(app); });
}

void Server::begin_drain() {
  // Before /readyz tells of it.
  state_->app.services.jobs.refuse_new();
  state_->app.draining = true;
}

void Server::stop() {
  App& app = state_->app;
  app.stopping = true;
  app.services.estimator.stop();
  app.services.library.stop_imports();
  app.services.jobs.close();
  if (state_->watching.joinable()) state_->watching.join();
  app.connections.close(limits::kLastResponses);
}

}  // namespace isomesh::http
