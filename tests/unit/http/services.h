// The services of a server on a data folder of its own.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "server/http/app/services.h"
#include "server/store/files/blob_store.h"
#include "server/store/retention.h"
#include "server/store/sql/outbox.h"
#include "server/store/sql/volume_store.h"
#include "server/store/sqlite/database.h"
#include "server/store/sqlite/job_store.h"
#include "tests/support/files.h"

namespace isomesh::http {

// Can tell the end of a job later than it can be read.
class LateJobStore : public store::SqliteJobStore {
 public:
  using SqliteJobStore::SqliteJobStore;

  std::vector<store::Event> events(const store::Viewer& viewer, const std::string& job,
                                   std::uint64_t since,
                                   std::chrono::milliseconds timeout) const override {
    auto events = SqliteJobStore::events(viewer, job, since, timeout);
    if (is_late) {
      std::erase_if(events,
                    [](const auto& event) { return event.kind == store::EventKind::kDone; });
    }
    return events;
  }

  void close() override {
    SqliteJobStore::close();
    is_closed = true;
    is_closed.notify_all();
  }

  std::atomic<bool> is_late = false;
  std::atomic<bool> is_closed = false;
};

class OpenServices {
 public:
  store::SqlVolumeStore& volumes() { return volumes_; }
  LateJobStore& jobs() { return jobs_; }
  store::AuditTrail& audit() { return audit_; }
  store::SqlDatabase& database() { return database_; }
  void damage_volume(const std::string& id) {
    database_.change(store::Change::kNew, [&](store::SqlTransaction& transaction) {
      transaction.connection().run("UPDATE volumes SET record = '#' WHERE id = ?1", id);
      transaction.commit();
      return 0;
    });
  }
  Services all(Wing* wing = nullptr) {
    return {.folder = data_,
            .blobs = blobs_,
            .volumes = volumes_,
            .jobs = jobs_,
            .outbox = outbox_,
            .audit = audit_,
            .library = library_,
            .histograms = histograms_,
            .labels = labels_,
            .estimator = estimator_,
            .retention = retention_,
            .metrics = metrics_,
            .callbacks = callbacks_,
            .callback_targets = targets_,
            .wing = wing};
  }

 private:
  test::TemporaryFolder folder_;
  store::DataFolder data_{folder_ / "data"};
  store::Database database_{data_};
  store::FileBlobStore blobs_{data_};
  store::SqlVolumeStore volumes_{database_};
  LateJobStore jobs_{database_, blobs_, store::JobStoreOptions{}};
  store::Retention retention_{jobs_, volumes_, blobs_, data_.scratch(), store::RetentionOptions{}};
  jobs::VolumeLibrary library_{
      data_, blobs_, volumes_, retention_, volume::SizeLimits{}, jobs::RunnerOptions{}};
  jobs::Histograms histograms_{blobs_};
  jobs::LabelLists labels_{blobs_};
  jobs::Estimator estimator_{volumes_, blobs_, jobs_, jobs::PipelineLimits{}, jobs::JobProgram{}};
  Metrics metrics_;
  store::SqlOutbox outbox_{database_};
  store::AuditTrail audit_{database_};
  const callbacks::CallbackTargets targets_{{}};
  callbacks::Callbacks callbacks_{outbox_, targets_, {}, {}};
};

}  // namespace isomesh::http
