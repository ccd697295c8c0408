// Processes that share the records of one PostgreSQL, for tests of what they do together.
#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>

#include <gmock/gmock.h>

#include "server/hospital/records/tables.h"
#include "server/store/files/blob_store.h"
#include "server/store/job_rules.h"
#include "server/store/postgresql/database.h"
#include "server/store/postgresql/job_store.h"
#include "server/store/postgresql/outbox.h"
#include "server/store/sql/volume_store.h"
#include "tests/support/files.h"
#include "tests/support/postgres.h"
#include "tests/support/stores.h"

namespace isomesh::store::postgresql {

using std::chrono::milliseconds;
using std::chrono::seconds;
using test::Postgres;

inline constexpr milliseconds kLongLease{600'000};
inline constexpr milliseconds kLong{60'000};
inline constexpr const char* kVolume = "some-volume";

// A steady clock that goes on as the test says.
class SetClock {
 public:
  void pass(milliseconds time) { now_ = now_.load() + time; }
  std::function<Steady()> reader() const {
    return [this] { return now_.load(); };
  }

 private:
  std::atomic<Steady> now_ = Steady::clock::now();
};

// A process, but that it shares this one's memory.
struct Node {
  Node(const std::string& url, const std::string& name, BlobStore& shared,
       JobStoreOptions options = {.grace = milliseconds(0)})
      : database(
            {.url = url, .node = name, .patience = seconds(60), .components = {order_tables()}}),
        volumes(database),
        outbox(database),
        jobs(database, shared, for_tests(std::move(options))) {}

  static JobStoreOptions for_tests(JobStoreOptions options) {
    options.retry_delay = milliseconds(0);
    if (options.mesher_version.empty()) options.mesher_version = "test";
    return options;
  }

  Lease claimed(milliseconds lease = kLongLease) { return jobs.claim("worker", lease).value(); }
  bool can_claim() { return jobs.wait_for_work({}, milliseconds(0)); }

  Database database;
  SqlVolumeStore volumes;
  PostgresOutbox outbox;
  PostgresJobStore jobs;
};

class ClusterTest : public testing::Test {
 protected:
  ClusterTest() : folder_(files_ / "data"), blobs_(shared_folder(), folder_.reserve()) {}

  void SetUp() override {
    if (!Postgres::is_here()) GTEST_SKIP() << "PostgreSQL is not installed";
    url_ = Postgres::shared().new_place();
    one_.emplace(url_, "one", blobs_);
    two_.emplace(url_, "two", blobs_);
    Volume volume;
    volume.id = kVolume;
    volume.samples = kVolume;
    volume.created = "2024-01-01T00:00:00.000Z";
    one_->volumes.add("", volume);
  }

  static JobSpec spec(double iso = 60, const std::string& key = "") {
    JobSpec spec;
    spec.parameters.volume = kVolume;
    spec.parameters.iso = iso;
    spec.idempotency_key = key;
    return spec;
  }
  std::string submit(double iso = 60) { return job_of(one().jobs.submit(spec(iso))).id; }

  Outcome mesh() {
    Outcome outcome;
    MeshFile& file = outcome.mesh.emplace().files[MeshFormat::kDrc];
    const Blob blob = test::put(blobs_, "mesh");
    file.sha256 = blob.key;
    file.bytes = blob.bytes;
    return outcome;
  }
  // As when the network fails or the server restarts.
  void cut_connections() {
    Postgres::ask(url_,
                  "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE pid <> "
                  "pg_backend_pid() AND backend_type = 'client backend'");
  }
  std::string ask(const std::string& sql) { return Postgres::ask(url_, sql); }
  // As when their time is over.
  void end_leases() { ask("UPDATE runs SET lease_until = 0"); }

  BlobFolders shared_folder() const {
    std::filesystem::create_directory(files_ / "shared");
    return shared_blob_folders(files_ / "shared");
  }

  Node& one() { return *one_; }
  Node& two() { return *two_; }

  test::TemporaryFolder files_;
  DataFolder folder_;
  FileBlobStore blobs_;
  std::string url_;
  std::optional<Node> one_;
  std::optional<Node> two_;
};

}  // namespace isomesh::store::postgresql
