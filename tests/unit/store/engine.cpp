#include "tests/unit/store/engine.h"

#include <optional>
#include <vector>

#include "base/clock.h"
#include "server/hospital/records/order_store.h"
#include "server/hospital/records/received_store.h"
#include "server/hospital/records/tables.h"
#include "server/store/audit/trail.h"
#include "server/store/file.h"
#include "server/store/files/blob_store.h"
#include "server/store/postgresql/database.h"
#include "server/store/postgresql/job_store.h"
#include "server/store/postgresql/outbox.h"
#include "server/store/sql/outbox.h"
#include "server/store/sql/volume_store.h"
#include "server/store/sqlite/database.h"
#include "server/store/sqlite/job_store.h"
#include "tests/support/files.h"
#include "tests/support/postgres.h"
#include "tests/support/stores.h"
#include "tests/unit/store/power_cut.h"

namespace isomesh::test {
namespace {

const std::vector<store::Schema> kTables = {store::order_tables()};

// The stores on one kind of database, with their blobs in a data folder.
template <class Database, class OutboxOfKind, class JobStoreOfKind>
class EngineOn : public Engine {
 public:
  store::JobStore& jobs() override { return *jobs_; }
  store::VolumeStore& volumes() override { return *volumes_; }
  store::BlobStore& blobs() override { return *blobs_; }
  store::Outbox& outbox() override { return *outbox_; }
  store::OrderStore& orders() override { return *orders_; }
  store::AuditTrail& audit() override { return *audit_; }
  store::ReceivedStore& received() override { return *received_; }
  store::SqlDatabase& database() override { return *database_; }

 protected:
  explicit EngineOn(const EngineOptions& options) : options_(options) {}

  void close() {
    received_.reset();
    audit_.reset();
    orders_.reset();
    outbox_.reset();
    jobs_.reset();
    volumes_.reset();
    database_.reset();
  }

  void open(const auto&... place_of_database) {
    database_.emplace(place_of_database...);
    volumes_.emplace(*database_);
    outbox_.emplace(*database_);
    orders_.emplace(*database_);
    audit_.emplace(*database_);
    received_.emplace(*database_);
    jobs_.emplace(*database_, *blobs_,
                  store::JobStoreOptions{.max_queued = options_.max_queued,
                                         .retry_delay = options_.retry_delay,
                                         .mesher_version = "test",
                                         .grace = std::chrono::milliseconds(0),
                                         .expected_ms = options_.expected_ms});
  }

  const EngineOptions options_;
  TemporaryFolder folder_;
  std::optional<store::DataFolder> data_;
  std::optional<store::FileBlobStore> blobs_;
  std::optional<Database> database_;
  std::optional<store::SqlVolumeStore> volumes_;
  std::optional<OutboxOfKind> outbox_;
  std::optional<store::OrderStore> orders_;
  std::optional<store::AuditTrail> audit_;
  std::optional<store::ReceivedStore> received_;
  std::optional<JobStoreOfKind> jobs_;
};

class SqliteEngine : public EngineOn<store::Database, store::SqlOutbox, store::SqliteJobStore> {
 public:
  explicit SqliteEngine(const EngineOptions& options) : EngineOn(options) { begin_life(); }

  void restart() override {
    close();
    open(*data_, kTables);
    jobs_->reap();
  }

  void lose_power() override {
    power_.value().leave(place_of(lives_ + 1));
    close();
    power_.reset();
    begin_life();
    jobs_->reap();
  }

 private:
  std::filesystem::path place_of(int life) const { return folder_ / std::to_string(life); }

  void begin_life() {
    ++lives_;
    const std::filesystem::path place = place_of(lives_);
    std::filesystem::create_directories(place);
    if (options_.may_lose_power) {
      power_.emplace(place);
      // Sync everything that the previous run left.
      for (const auto& entry : std::filesystem::recursive_directory_iterator(place)) {
        if (entry.is_regular_file()) store::File::open(entry.path()).sync();
        if (entry.is_directory()) store::sync_folder(entry.path());
      }
      store::sync_folder(place);
    }
    data_.emplace(place);
    blobs_.emplace(*data_);
    open(*data_, kTables);
  }

  int lives_ = 0;
  std::optional<PowerCut> power_;
};

// One node of a cluster.
class PostgresEngine
    : public EngineOn<store::postgresql::Database, store::postgresql::PostgresOutbox,
                      store::postgresql::PostgresJobStore> {
 public:
  explicit PostgresEngine(const EngineOptions& options) : EngineOn(options) {
    data_.emplace(folder_ / "data");
    blobs_.emplace(*data_);
    open(database_options_);
  }

  void restart() override {
    jobs_.reset();
    open(database_options_);
    jobs_->reap();
  }

  // Simulates a power loss of the server by stopping it at once; its disk is not simulated.
  void lose_power() override {
    jobs_.reset();
    Postgres::shared().stop_at_once();
    Postgres::shared().start();
    open(database_options_);
    jobs_->reap();
  }

 private:
  const store::postgresql::DatabaseOptions database_options_{.url = Postgres::shared().new_place(),
                                                             .node = "one",
                                                             .patience = std::chrono::minutes(1),
                                                             .components = kTables};
};

template <class Kind>
NamedEngine engine(const char* name) {
  return {name, [](const EngineOptions& options) -> std::unique_ptr<Engine> {
            return std::make_unique<Kind>(options);
          }};
}

}  // namespace

std::vector<NamedEngine> all_engines() {
  std::vector<NamedEngine> engines = {engine<SqliteEngine>("Sqlite")};
  if (Postgres::is_here()) engines.push_back(engine<PostgresEngine>("Postgresql"));
  return engines;
}

// So that nobody takes a suite that has run on one engine for one that has run on all.
TEST(Engines, AreAllHere) {
  if (!Postgres::is_here()) GTEST_SKIP() << "PostgreSQL is not installed: nothing runs on it";
  EXPECT_EQ(all_engines().size(), 2U);
}

void EngineTest::make(const EngineOptions& options) {
  engine_ = GetParam().make(options);
  add_volume("", kVolume);
  add_volume("other", kVolume);
}

void EngineTest::add_volume(const std::string& owner, const std::string& id) {
  Volume volume;
  volume.id = id;
  volume.samples = id;
  volume.format = "raw";
  volume.created = "2024-01-01T00:00:00.000Z";
  volumes().add(owner, volume);
}

JobParameters EngineTest::parameters(Priority priority) {
  JobParameters result;
  result.volume = kVolume;
  result.iso = 60;
  result.priority = priority;
  return result;
}

JobParameters EngineTest::unlike(Priority priority) {
  JobParameters result = parameters(priority);
  result.iso = 1000 + ++last_iso_;
  return result;
}

Job EngineTest::submit(const JobParameters& parameters, const std::string& owner) {
  return job_of(jobs().submit({owner, parameters, "", ""}));
}

store::Lease EngineTest::claimed(std::chrono::milliseconds lease) {
  return jobs().claim("worker", lease).value();
}

std::string EngineTest::put_blob(const std::string& text) { return put(blobs(), text).key; }

store::Outcome EngineTest::mesh_of(const std::vector<store::Blob>& blobs) {
  store::Outcome outcome;
  outcome.mesh.emplace().triangles = 12;
  for (std::size_t n = 0; n < blobs.size(); ++n) {
    MeshFile& file = outcome.mesh->files[MeshFormat{static_cast<int>(n)}];
    file.sha256 = blobs[n].key;
    file.bytes = blobs[n].bytes;
  }
  return outcome;
}

store::Outcome EngineTest::some_mesh() { return mesh_of({{put_blob("some mesh"), 9}}); }

store::Outcome EngineTest::failure(bool may_retry) {
  store::Outcome outcome;
  outcome.error = to_problem(Error(ErrorCode::kTooLarge, "too large"), "/v1/jobs/x");
  outcome.may_retry = may_retry;
  return outcome;
}

bool EngineTest::end(store::OrderRecord record, OrderState state, store::Time finished) {
  record.order.state = state;
  record.order.finished = timestamp_of(finished);
  return orders().save(record, finished);
}

}  // namespace isomesh::test
