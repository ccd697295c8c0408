// The public description has every route of the server and no other.
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include "server/hospital/routes.h"
#include "server/http/routes/routes.h"
#include "server/store/files/blob_store.h"
#include "server/store/retention.h"
#include "server/store/sql/outbox.h"
#include "server/store/sql/volume_store.h"
#include "server/store/sqlite/database.h"
#include "server/store/sqlite/job_store.h"
#include "tests/support/files.h"

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
    hospital::add_order_routes(app_, nullptr);
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
    return methods;
  }

  test::TemporaryFolder folder_;
  store::DataFolder data_{folder_ / "data"};
  store::Database database_{data_};
  store::FileBlobStore blobs_{data_};
  store::SqlVolumeStore volumes_{database_};
  store::SqliteJobStore jobs_{database_, blobs_, store::JobStoreOptions{}};
  store::Retention retention_{jobs_, volumes_, blobs_, data_.scratch(), store::RetentionOptions{}};
  jobs::VolumeLibrary library_{
      data_, blobs_, volumes_, retention_, volume::SizeLimits{}, jobs::RunnerOptions{}};
  jobs::Histograms histograms_{blobs_};
  jobs::LabelLists labels_{blobs_};
  jobs::Estimator estimator_{volumes_, blobs_, jobs_, jobs::PipelineLimits{}, jobs::JobProgram{}};
  Metrics metrics_;
  store::SqlOutbox outbox_{database_};
  const callbacks::CallbackTargets targets_{{}};
  callbacks::Callbacks callbacks_{outbox_, targets_, {}, {}};
  App app_{Services{.folder = data_,
                    .blobs = blobs_,
                    .volumes = volumes_,
                    .jobs = jobs_,
                    .outbox = outbox_,
                    .library = library_,
                    .histograms = histograms_,
                    .labels = labels_,
                    .estimator = estimator_,
                    .retention = retention_,
                    .metrics = metrics_,
                    .callbacks = callbacks_,
                    .callback_targets = targets_},
           ServerOptions{}};
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

}  // namespace
}  // namespace isomesh::http
