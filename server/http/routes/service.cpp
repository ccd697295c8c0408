#include <chrono>
#include <filesystem>

#include <nlohmann/json.hpp>

#include "proto/json_values.h"
#include "server/codec/mesher_version.h"
#include "server/http/requests/request_values.h"
#include "server/http/routes/openapi.h"
#include "server/http/routes/routes.h"

namespace isomesh::http {
namespace {

Levels levels_of(const App& app) {
  const store::QueueDepth depth = app.services.jobs.depth(std::nullopt);
  Levels levels;
  for (std::size_t i = 0; i < levels.queued.size(); ++i) levels.queued[i] = depth.queued[i];
  levels.running = depth.running;
  levels.waiting_for_disk = depth.waiting_for_disk;
  levels.uploads = app.uploads.taken();
  levels.callbacks = app.services.outbox.count();
  levels.disk_used_bytes = app.services.retention.named_bytes();
  std::error_code unknown;  // then 0 is reported
  const auto space = std::filesystem::space(app.services.folder.blobs(), unknown);
  if (!unknown) levels.disk_free_bytes = space.available;
  if (app.services.wing != nullptr) levels.others = app.services.wing->measure();
  return levels;
}

// OpenMetrics, unless Accept prefers the other. So requests without the header, of any type, and of
// types that there are not, get it too.
MetricsFormat metrics_format_for(const Request& request) {
  return accepted_weight(request, "text/plain", "0.0.4") >
                 accepted_weight(request, "application/openmetrics-text", "1.0.0")
             ? MetricsFormat::kPrometheusText
             : MetricsFormat::kOpenMetrics;
}

}  // namespace

void add_service_routes(App& app) {
  add_get(app, "/livez",
          [](const auto& /*request*/, auto& response) { response.set_body("ok\n", "text/plain"); });
  add_get(app, "/readyz", [&app](const auto& /*request*/, auto& response) {
    if (app.draining) throw Error(ErrorCode::kUnavailable, "the service is shutting down");
    const std::string reason = app.readiness.reason();
    if (!reason.empty()) throw Error(ErrorCode::kUnavailable, reason);
    response.set_body("ok\n", "text/plain");
  });
  add_get(app, "/version", [&app](const auto& request, auto& response) {
    check_known(request, {});
    const bool takes_orders = app.services.wing != nullptr && app.services.wing->is_open();
    JsonTree version;
    json_values::write_field(version.root(), "version", std::string(ISOMESH_VERSION));
    json_values::write_field(version.root(), "mesher", std::string(codec::kMesherVersion));
    json_values::write_field(version.root(), "orders", takes_orders);
    response.set_body(dump(version.root()), "application/json");
  });
  add_get(app, "/openapi.yaml", [](const auto& /*request*/, auto& response) {
    response.set_body(kOpenApi, "application/yaml");
  });
  add_get(app, "/metrics", [&app](const auto& request, auto& response) {
    check_known(request, {});
    const MetricsFormat format = metrics_format_for(request);
    response.add_header("Vary", "Accept");
    response.set_body(app.metrics.text(levels_of(app), format), media_type_of(format));
  });
}

}  // namespace isomesh::http
