// The stores of an engine, for the tests that every engine has to pass. Another engine derives from
// Engine, adds itself to all_engines() and gets the whole suite.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/hospital/records/order_store.h"
#include "server/hospital/records/received_store.h"
#include "server/store/audit/trail.h"
#include "server/store/blob_store.h"
#include "server/store/job_store.h"
#include "server/store/outbox.h"
#include "server/store/sql/sql.h"
#include "server/store/volume_store.h"

namespace isomesh::test {

struct EngineOptions {
  std::size_t max_queued = 100'000;
  std::chrono::milliseconds retry_delay{0};
  bool may_lose_power = false;
  std::function<double(const Volume&, const JobParameters&)> expected_ms =
      [](const Volume&, const JobParameters&) { return 1.0; };
};

// Empty stores that belong together, gone with all they hold when it goes.
class Engine {
 public:
  virtual ~Engine() = default;

  virtual store::JobStore& jobs() = 0;
  virtual store::VolumeStore& volumes() = 0;
  virtual store::BlobStore& blobs() = 0;
  virtual store::Outbox& outbox() = 0;
  virtual store::OrderStore& orders() = 0;
  virtual store::AuditTrail& audit() = 0;
  virtual store::ReceivedStore& received() = 0;
  // Under the stores, for what they do not do.
  virtual store::SqlDatabase& database() = 0;

  // As after a crash: the stores are opened anew on what is on disk, and nobody holds a lease. What
  // was returned before is not valid any more.
  virtual void restart() = 0;

  // As restart, on what a power cut leaves: only what was brought to the disk. For engines that may
  // lose power.
  virtual void lose_power() = 0;
};

using MakeEngine = std::unique_ptr<Engine> (*)(const EngineOptions& options);

struct NamedEngine {
  const char* name;
  MakeEngine make;
};

std::vector<NamedEngine> all_engines();

inline std::string name_of(const testing::TestParamInfo<NamedEngine>& engine) {
  return engine.param.name;
}

// An engine of the parameter's kind with one volume of each of two owners.
class EngineTest : public testing::TestWithParam<NamedEngine> {
 protected:
  static constexpr const char* kVolume = "some-volume";

  EngineTest() { make({}); }

  // Starts over with other options.
  void make(const EngineOptions& options);

  void add_volume(const std::string& owner, const std::string& id);

  static JobParameters parameters(Priority priority = Priority::kRoutine);

  // A job unlike all others of the test.
  JobParameters unlike(Priority priority = Priority::kRoutine);

  Job submit(const JobParameters& parameters, const std::string& owner = "");
  Job submit() { return submit(unlike()); }

  // Takes the next job; there must be one.
  store::Lease claimed(std::chrono::milliseconds lease = kLongLease);
  bool can_claim() { return jobs().wait_for_work({}, std::chrono::milliseconds(0)); }

  std::string put_blob(const std::string& text);

  // A mesh in blobs of these keys.
  static store::Outcome mesh_of(const std::vector<store::Blob>& blobs);
  store::Outcome some_mesh();
  static store::Outcome failure(bool may_retry = false);

  static store::Time now() { return std::chrono::system_clock::now(); }
  bool end(store::OrderRecord record, OrderState state, store::Time finished = now());

  store::JobStore& jobs() { return engine_->jobs(); }
  store::VolumeStore& volumes() { return engine_->volumes(); }
  store::BlobStore& blobs() { return engine_->blobs(); }
  store::Outbox& outbox() { return engine_->outbox(); }
  store::OrderStore& orders() { return engine_->orders(); }
  store::AuditTrail& audit() { return engine_->audit(); }
  store::ReceivedStore& received() { return engine_->received(); }
  // One wrong byte in the record of a job or an order.
  void damage(const std::string& table, const std::string& id) {
    damage(table, "record", "id", id);
  }
  void damage(const std::string& table, const std::string& column, const std::string& key,
              const std::string& id) {
    engine_->database().run(store::Change::kRepeatable,
                            "UPDATE " + table + " SET " + column + " = '#' || substr(" + column +
                                ", 2) WHERE " + key + " = ?1",
                            id);
  }
  store::SqlDatabase& database() { return engine_->database(); }
  void restart() { engine_->restart(); }
  void lose_power() { engine_->lose_power(); }

  static constexpr std::chrono::milliseconds kLongLease{600'000};
  static constexpr std::chrono::milliseconds kLong{60'000};

 private:
  std::unique_ptr<Engine> engine_;
  int last_iso_ = 0;
};

}  // namespace isomesh::test
