#include "server/record_stores.h"

#include <filesystem>
#include <string>

#include "base/ids.h"
#include "server/codec/mesher_version.h"
#include "server/jobs/making/stage_times.h"
#include "server/jobs/queue/pipeline.h"
#include "server/store/audit/trail.h"
#include "server/store/postgresql/database.h"
#include "server/store/postgresql/held_task.h"
#include "server/store/postgresql/identity.h"
#include "server/store/postgresql/job_store.h"
#include "server/store/postgresql/outbox.h"
#include "server/store/sql/outbox.h"
#include "server/store/sql/volume_store.h"
#include "server/store/sqlite/database.h"
#include "server/store/sqlite/identity.h"
#include "server/store/sqlite/job_store.h"
#include "server/wings.h"

namespace isomesh {
namespace {

store::JobStoreOptions job_options(const Options& options) {
  store::JobStoreOptions result = options.jobs;
  result.mesher_version = codec::kMesherVersion;
  result.job_version = jobs::kJobVersion;
  result.expected_ms = jobs::expected_ms;
  return result;
}

// Common to all databases; they are opened first.
class SqlStores : public RecordStores {
 public:
  explicit SqlStores(store::SqlDatabase& database)
      : database_(database), volumes_(database), audit_(database) {}

  store::VolumeStore& volumes() override { return volumes_; }
  store::AuditTrail& audit() override { return audit_; }
  store::SqlDatabase& database() override { return database_; }

 private:
  store::SqlDatabase& database_;
  store::SqlVolumeStore volumes_;
  store::AuditTrail audit_;
};

// In the data folder, which one process owns.
class FolderStores : public SqlStores {
 public:
  FolderStores(const Options& options, std::unique_ptr<store::Database> database,
               store::BlobStore& blobs, std::chrono::milliseconds tolerance)
      : SqlStores(*database),
        database_(std::move(database)),
        identity_(*database_, blobs, options.overrides, {.tolerance = tolerance}),
        jobs_(*database_, blobs, job_options(options)),
        outbox_(*database_) {}

  store::JobStore& jobs() override { return jobs_; }
  store::Outbox& outbox() override { return outbox_; }
  store::Time now() override { return identity_.now(); }
  std::string keep_task() override { return ""; }
  bool has_task(store::SqlConnection& /*connection*/) override { return true; }

 private:
  std::unique_ptr<store::Database> database_;
  store::Identity identity_;
  store::SqliteJobStore jobs_;
  store::SqlOutbox outbox_;
};

// Requests wait for each other, because a database server has few connections.
constexpr std::size_t kRequestConnections = 12;

// In a database shared by several processes.
class SharedStores : public SqlStores {
 public:
  SharedStores(const Options& options, std::unique_ptr<store::postgresql::Database> database,
               store::BlobStore& blobs, std::chrono::milliseconds tolerance)
      : SqlStores(*database),
        database_(std::move(database)),
        identity_(*database_, blobs, options.overrides, tolerance),
        jobs_(*database_, blobs, job_options(options)),
        outbox_(*database_),
        task_(*database_, "orders") {}

  store::JobStore& jobs() override { return jobs_; }
  store::Outbox& outbox() override { return outbox_; }
  store::Time now() override { return identity_.now(); }
  std::string keep_task() override { return task_.keep(); }
  bool has_task(store::SqlConnection& connection) override { return task_.is_ours(connection); }

 private:
  std::unique_ptr<store::postgresql::Database> database_;
  store::postgresql::Identity identity_;
  store::postgresql::PostgresJobStore jobs_;
  store::postgresql::PostgresOutbox outbox_;
  store::postgresql::HeldTask task_;
};

}  // namespace

std::unique_ptr<RecordStores> open_record_stores(const Options& options,
                                                 const store::DataFolder& folder,
                                                 store::BlobStore& blobs,
                                                 std::chrono::milliseconds tolerance) {
  if (options.store.empty()) {
    return std::make_unique<FolderStores>(
        options, std::make_unique<store::Database>(folder, wing_entry().tables), blobs, tolerance);
  }
  store::postgresql::check_url(options.store);
  // A copied folder on another machine is another node.
  auto database = std::make_unique<store::postgresql::Database>(
      store::postgresql::DatabaseOptions{.url = options.store,
                                         .node = folder.name() + '@' + host_name(),
                                         .connections = kRequestConnections + options.workers,
                                         .components = wing_entry().tables});
  return std::make_unique<SharedStores>(options, std::move(database), blobs, tolerance);
}

void with_trail(const Options& options, const std::function<void(store::SqlConnection&)>& act) {
  if (!options.store.empty()) {
    store::postgresql::check_url(options.store);
    return act(*store::postgresql::connect_to_trail(options.store, wing_entry().tables));
  }
  const std::filesystem::path file = options.data / "isomesh.sqlite";
  if (!std::filesystem::exists(file)) {
    throw Error(ErrorCode::kNotFound, "the data folder has no data of isomeshd");
  }
  store::Connection connection(file, store::Connection::Mode::kRead);
  store::check_versions(connection, wing_entry().tables);
  store::refuse_moved(connection);
  act(connection);
}

}  // namespace isomesh
