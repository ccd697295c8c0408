// The public description has every route of the server and no other.
#include <cstddef>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include "server/http/routes/routes.h"
#include "tests/unit/http/services.h"
#ifdef ISOMESH_HOSPITAL
#include "server/hospital/routes.h"
#include "server/hospital/worklist_routes.h"
#endif

namespace isomesh::http {
namespace {

using Methods = std::set<std::string>;

class OpenApi : public testing::Test {
 protected:
  OpenApi() {
    add_volume_routes(app_);
    add_upload_routes(app_);
    add_job_routes(app_);
    add_mesh_routes(app_);
    add_inspect_routes(app_);
    add_page_routes(app_);
    add_service_routes(app_);
    own_routes_ = app_.router.routes().size();
#ifdef ISOMESH_HOSPITAL
    hospital::add_order_routes(app_, nullptr);
    hospital::add_worklist_routes(app_, nullptr);
#endif
  }

  static Methods methods_of(const Route& route) {
    Methods methods;
    for (const auto& [method, handler] : route.handlers()) methods.insert(method);
    return methods;
  }

  // HEAD is not described: it is there wherever GET is.
  static Methods methods_of(const YAML::Node& path_item) {
    Methods methods;
    if (path_item["get"]) methods.merge(Methods{"GET", "HEAD"});
    if (path_item["post"]) methods.insert("POST");
    if (path_item["delete"]) methods.insert("DELETE");
    if (path_item["patch"]) methods.insert("PATCH");
    if (path_item["put"]) methods.insert("PUT");
    return methods;
  }

  OpenServices services_;
  App app_{services_.all(), ServerOptions{}};
  std::size_t own_routes_ = 0;  // the others are a wing's
  const YAML::Node description_ = YAML::LoadFile(ISOMESH_OPENAPI);
};

TEST_F(OpenApi, DescribesEveryRouteWithItsMethods) {
  for (const Route& route : app_.router.routes()) {
    if (route.pattern().starts_with("/assets/")) continue;  // the page's own, described with it
    const YAML::Node path = description_["paths"][route.pattern()];
    ASSERT_TRUE(path) << route.pattern();
    EXPECT_EQ(methods_of(path), methods_of(route)) << route.pattern();
  }
}

// Load balancers tell them apart (docs/cluster.md).
TEST_F(OpenApi, TagsTheRoutesThatOneDaemonHas) {
  for (std::size_t n = 0; n < app_.router.routes().size(); ++n) {
    const std::string& pattern = app_.router.routes()[n].pattern();
    if (pattern.starts_with("/assets/")) continue;
    for (const auto& operation : description_["paths"][pattern]) {
      if (!operation.second.IsMap() || !operation.second["tags"]) continue;
      EXPECT_EQ(operation.second["tags"][0].as<std::string>() == "orders", n >= own_routes_)
          << pattern;
    }
  }
}

}  // namespace
}  // namespace isomesh::http
