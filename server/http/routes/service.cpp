#include "proto/json_values.h"
#include "server/http/requests/request_values.h"
#include "server/http/routes/openapi.h"
#include "server/http/routes/routes.h"
#include "server/jobs/queue/pipeline.h"

namespace isomesh::http {

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
    const bool takes_orders = app.services.hospital != nullptr && app.services.hospital->is_open();
    JsonTree version;
    json_values::write_field(version.root(), "version", std::string(ISOMESH_VERSION));
    json_values::write_field(version.root(), "mesher", std::string(jobs::kMesherVersion));
    json_values::write_field(version.root(), "orders", takes_orders);
    response.set_body(dump(version.root()), "application/json");
  });
  add_get(app, "/openapi.yaml", [](const auto& /*request*/, auto& response) {
    response.set_body(kOpenApi, "application/yaml");
  });
}

}  // namespace isomesh::http
