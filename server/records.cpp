#include "server/records.h"

#include <array>
#include <optional>
#include <string>

#include <unistd.h>

#include "base/ids.h"
#include "server/jobs/pipeline.h"
#include "server/store/postgresql/audit_trail.h"
#include "server/store/postgresql/database.h"
#include "server/store/postgresql/identity.h"
#include "server/store/postgresql/job_store.h"
#include "server/store/postgresql/order_store.h"
#include "server/store/postgresql/outbox.h"
#include "server/store/postgresql/received_store.h"
#include "server/store/postgresql/turn.h"
#include "server/store/postgresql/volume_store.h"
#include "server/store/sqlite/audit_trail.h"
#include "server/store/sqlite/database.h"
#include "server/store/sqlite/identity.h"
#include "server/store/sqlite/job_store.h"
#include "server/store/sqlite/order_store.h"
#include "server/store/sqlite/outbox.h"
#include "server/store/sqlite/received_store.h"
#include "server/store/sqlite/volume_store.h"

namespace isomesh {
namespace {

store::JobStoreOptions job_options(const Options& options) {
  store::JobStoreOptions result = options.jobs;
  result.mesher_version = jobs::kMesherVersion;
  return result;
}

// In the data folder, which one process has.
class SqliteRecords : public Records {
 public:
  SqliteRecords(const Options& options, const store::DataFolder& folder, store::BlobStore& blobs,
                std::chrono::milliseconds tolerance)
      : database_(folder),
        identity_(database_, blobs, options.word, {.tolerance = tolerance}),
        volumes_(database_),
        jobs_(database_, blobs, job_options(options)),
        outbox_(database_),
        orders_(database_),
        audit_(database_),
        received_(database_) {}

  store::JobStore& jobs() override { return jobs_; }
  store::VolumeStore& volumes() override { return volumes_; }
  store::Outbox& outbox() override { return outbox_; }
  store::OrderStore& orders() override { return orders_; }
  store::AuditTrail& audit() override { return audit_; }
  store::ReceivedStore& received() override { return received_; }
  store::Time now() override { return identity_.now(); }
  void take_orders() override {}

 private:
  store::Database database_;
  store::Identity identity_;
  store::SqliteVolumeStore volumes_;
  store::SqliteJobStore jobs_;
  store::SqliteOutbox outbox_;
  store::SqliteOrderStore orders_;
  store::SqliteAuditTrail audit_;
  store::SqliteReceivedStore received_;
};

std::string host_of_node() {
  std::array<char, 256> name = {};
  return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "-";
}

// Requests wait for each other rather than for many connections, of which a server has few.
constexpr std::size_t kRequestConnections = 12;

// In a database that several processes share.
class PostgresRecords : public Records {
 public:
  PostgresRecords(const Options& options, const store::DataFolder& folder, store::BlobStore& blobs,
                  std::chrono::milliseconds tolerance)
      : url_(options.store),
        // A copy of a folder on another machine is another one.
        database_({.url = options.store,
                   .node = folder.name() + '@' + host_of_node(),
                   .connections = kRequestConnections + options.workers}),
        identity_(database_, blobs, options.word, tolerance),
        volumes_(database_),
        jobs_(database_, blobs, job_options(options)),
        outbox_(database_),
        orders_(database_),
        audit_(database_),
        received_(database_) {}

  store::JobStore& jobs() override { return jobs_; }
  store::VolumeStore& volumes() override { return volumes_; }
  store::Outbox& outbox() override { return outbox_; }
  store::OrderStore& orders() override { return orders_; }
  store::AuditTrail& audit() override { return audit_; }
  store::ReceivedStore& received() override { return received_; }
  store::Time now() override { return identity_.now(); }
  void take_orders() override {
    turn_.emplace(url_, "orders");
    if (turn_->is_taken()) return;
    throw Error(
        ErrorCode::kUnavailable,
        "another isomeshd with this database already has --hospital: only one may process orders");
  }

 private:
  const std::string url_;
  store::postgresql::Database database_;
  store::postgresql::Identity identity_;
  store::postgresql::PostgresVolumeStore volumes_;
  store::postgresql::PostgresJobStore jobs_;
  store::postgresql::PostgresOutbox outbox_;
  store::postgresql::PostgresOrderStore orders_;
  store::postgresql::PostgresAuditTrail audit_;
  store::postgresql::PostgresReceivedStore received_;
  std::optional<store::postgresql::Turn> turn_;
};

}  // namespace

std::unique_ptr<Records> open_records(const Options& options, const store::DataFolder& folder,
                                      store::BlobStore& blobs,
                                      std::chrono::milliseconds tolerance) {
  if (options.store.empty()) {
    return std::make_unique<SqliteRecords>(options, folder, blobs, tolerance);
  }
  store::postgresql::check_url(options.store);
  return std::make_unique<PostgresRecords>(options, folder, blobs, tolerance);
}

void read_audit_trail(const Options& options, std::uint64_t after,
                      const std::function<void(std::string_view line)>& line) {
  if (options.store.empty()) return store::read_audit_trail(options.data, after, line);
  store::postgresql::check_url(options.store);
  store::postgresql::Database database(
      {.url = options.store, .node = "audit " + random_hex(8), .connections = 1});
  store::postgresql::PostgresAuditTrail(database).read(after, line);
}

}  // namespace isomesh
