#include "server/record_stores.h"

#include <filesystem>
#include <string>

#include "base/ids.h"
#include "server/jobs/making/stage_times.h"
#include "server/jobs/queue/pipeline.h"
#include "server/store/postgresql/database.h"
#include "server/store/postgresql/held_task.h"
#include "server/store/postgresql/identity.h"
#include "server/store/postgresql/job_store.h"
#include "server/store/postgresql/outbox.h"
#include "server/store/sql/audit_trail.h"
#include "server/store/sql/order_store.h"
#include "server/store/sql/order_tables.h"
#include "server/store/sql/outbox.h"
#include "server/store/sql/received_store.h"
#include "server/store/sql/volume_store.h"
#include "server/store/sqlite/database.h"
#include "server/store/sqlite/identity.h"
#include "server/store/sqlite/job_store.h"

namespace isomesh {
namespace {

store::JobStoreOptions job_options(const Options& options) {
  store::JobStoreOptions result = options.jobs;
  result.mesher_version = jobs::kMesherVersion;
  result.job_version = jobs::kJobVersion;
  result.expected_ms = jobs::expected_ms;
  return result;
}

// Common to all databases; they are opened first.
class SqlStores : public RecordStores {
 public:
  explicit SqlStores(
      store::SqlDatabase& database,
      store::SqlOrderStore::IsOurs has_orders = [](store::SqlConnection&) { return true; })
      : volumes_(database),
        orders_(database, std::move(has_orders)),
        audit_(database),
        received_(database) {}

  store::VolumeStore& volumes() override { return volumes_; }
  store::OrderStore& orders() override { return orders_; }
  store::AuditTrail& audit() override { return audit_; }
  store::ReceivedStore& received() override { return received_; }

 private:
  store::SqlVolumeStore volumes_;
  store::SqlOrderStore orders_;
  store::SqlAuditTrail audit_;
  store::SqlReceivedStore received_;
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
  std::string keep_orders() override { return ""; }

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
      : SqlStores(*database,
                  [this](store::SqlConnection& connection) { return task_.is_ours(connection); }),
        database_(std::move(database)),
        identity_(*database_, blobs, options.overrides, tolerance),
        jobs_(*database_, blobs, job_options(options)),
        outbox_(*database_),
        task_(*database_, "orders") {}

  store::JobStore& jobs() override { return jobs_; }
  store::Outbox& outbox() override { return outbox_; }
  store::Time now() override { return identity_.now(); }
  std::string keep_orders() override { return task_.keep(); }

 private:
  std::unique_ptr<store::postgresql::Database> database_;
  store::postgresql::Identity identity_;
  store::postgresql::PostgresJobStore jobs_;
  store::postgresql::PostgresOutbox outbox_;
  store::postgresql::HeldTask task_;
};

}  // namespace

std::vector<store::Schema> components() { return {store::order_tables()}; }

std::unique_ptr<RecordStores> open_record_stores(const Options& options,
                                                 const store::DataFolder& folder,
                                                 store::BlobStore& blobs,
                                                 std::chrono::milliseconds tolerance) {
  if (options.store.empty()) {
    return std::make_unique<FolderStores>(
        options, std::make_unique<store::Database>(folder, components()), blobs, tolerance);
  }
  store::postgresql::check_url(options.store);
  // A copied folder on another machine is another node.
  auto database = std::make_unique<store::postgresql::Database>(
      store::postgresql::DatabaseOptions{.url = options.store,
                                         .node = folder.name() + '@' + host_name(),
                                         .connections = kRequestConnections + options.workers,
                                         .components = components()});
  return std::make_unique<SharedStores>(options, std::move(database), blobs, tolerance);
}

namespace {

// Calls `act` with a connection to the records.
template <class Act>
auto with_audit_trail(const Options& options, const Act& act) {
  if (!options.store.empty()) {
    store::postgresql::check_url(options.store);
    return act(*store::postgresql::connect_to_trail(options.store, components()));
  }
  const std::filesystem::path file = options.data / "isomesh.sqlite";
  if (!std::filesystem::exists(file)) {
    throw Error(ErrorCode::kNotFound, "the data folder has no data of isomeshd");
  }
  store::Connection connection(file, store::Connection::Mode::kRead);
  store::check_versions(connection, components());
  store::refuse_moved(connection);
  return act(connection);
}

}  // namespace

void read_audit_trail(const Options& options, std::uint64_t after,
                      const std::function<void(std::string_view line)>& line) {
  with_audit_trail(options, [&](store::SqlConnection& connection) {
    store::read_audit_trail(connection, after, line);
  });
}

store::AuditCheck verify_audit_trail(const Options& options) {
  return with_audit_trail(options, [](store::SqlConnection& connection) {
    return store::verify_audit_trail(connection);
  });
}

}  // namespace isomesh
