// The public description has every route of the server and no other.
#include <map>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include "server/http/routes.h"
#include "server/store/database.h"
#include "server/store/file_blob_store.h"
#include "server/store/retention.h"
#include "server/store/sqlite_job_store.h"
#include "server/store/sqlite_volume_store.h"
#include "tests/support/files.h"

namespace isomesh::http {
namespace {

using Methods = std::set<std::string>;

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t found = text.find(from);
  return found == std::string::npos ? text : text.replace(found, from.size(), to);
}

bool matches(const std::string& path, const std::string& pattern) {
  return testing::Matches(testing::MatchesRegex(pattern))(path);
}

class OpenApi : public testing::Test {
 protected:
  OpenApi() {
    add_volume_routes(app_);
    add_job_routes(app_);
    add_mesh_routes(app_);
    add_survey_routes(app_);
    add_page_routes(app_);
    add_service_routes(app_);
    add_metrics_route(app_);
  }

  // A path as a client would send it.
  static std::string example_of(const std::string& path) {
    return replaced(replaced(path, "{format}", "drc"), "{id}", "0123abcd");
  }

  // HEAD goes without saying where there is GET.
  static Methods methods_of(const YAML::Node& path_item) {
    Methods methods;
    if (path_item["get"]) methods.merge(Methods{"GET", "HEAD"});
    if (path_item["post"]) methods.insert("POST");
    if (path_item["delete"]) methods.insert("DELETE");
    return methods;
  }

  test::TemporaryFolder folder_;
  store::DataFolder data_{folder_ / "data"};
  store::Database database_{data_};
  store::FileBlobStore blobs_{data_};
  store::SqliteVolumeStore volumes_{database_};
  store::SqliteJobStore jobs_{database_, blobs_, store::JobStoreOptions{}};
  store::Retention retention_{data_, database_, blobs_, store::RetentionOptions{}};
  jobs::VolumeLibrary library_{data_, blobs_, volumes_, retention_, volume::ImportLimits{}};
  jobs::Histograms histograms_{blobs_};
  jobs::Estimator estimator_{volumes_, blobs_, jobs_, jobs::PipelineLimits{}};
  Metrics metrics_;
  store::Outbox outbox_{database_};
  const jobs::CallbackTargets targets_{{}};
  jobs::Callbacks callbacks_{outbox_, targets_, {}, {}};
  App app_{Services{data_, blobs_, volumes_, jobs_, library_, histograms_, estimator_, retention_,
                    metrics_, outbox_, callbacks_, targets_},
           ServerOptions{}};
  const YAML::Node description_ = YAML::LoadFile(ISOMESH_OPENAPI);
};

TEST_F(OpenApi, DescribesEveryRouteWithItsMethods) {
  for (const auto& [pattern, route] : app_.routes) {
    if (pattern.starts_with("/assets/")) continue;  // the page's own, told with it
    Methods described;
    for (const auto& path : description_["paths"]) {
      if (matches(example_of(path.first.as<std::string>()), pattern)) {
        described.merge(methods_of(path.second));
      }
    }
    EXPECT_EQ(described, route.methods) << pattern;
  }
}

TEST_F(OpenApi, DescribesNoOtherPath) {
  for (const auto& path : description_["paths"]) {
    const std::string example = example_of(path.first.as<std::string>());
    int routes = 0;
    for (const auto& [pattern, route] : app_.routes) {
      routes += matches(example, pattern) ? 1 : 0;
    }
    EXPECT_EQ(routes, 1) << example;
  }
}

}  // namespace
}  // namespace isomesh::http
