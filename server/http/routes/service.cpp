#include <nlohmann/json.hpp>

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
    const nlohmann::json version = {
        {"version", ISOMESH_VERSION},
        {"mesher", jobs::mesher_version()},
        {"orders", app.services.hospital != nullptr && app.services.hospital->is_open()}};
    response.set_body(version.dump(), "application/json");
  });
  add_get(app, "/openapi.yaml", [](const auto& /*request*/, auto& response) {
    response.set_body(kOpenApi, "application/yaml");
  });
}

}  // namespace isomesh::http
