// The interface of a component that a build can leave out.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/http/observe/metrics.h"
#include "server/jobs/library/label_lists.h"
#include "server/jobs/library/volume_library.h"
#include "server/process/child.h"
#include "server/store/audit/trail.h"
#include "server/store/blob_store.h"
#include "server/store/expiry.h"
#include "server/store/files/data_folder.h"
#include "server/store/job_store.h"
#include "server/store/sql/schema.h"
#include "server/store/volume_store.h"

namespace isomesh::http {

struct App;

struct WingSettings {
  std::filesystem::path file;  // its configuration; empty: it has none
  std::uint64_t max_upload_bytes = 0;
  std::chrono::hours keep{30 * 24};  // for ended work
  // The programs of this installation. Throws Error kInternal when one is missing.
  std::function<process::Program(const std::string& name)> program;
};

// Dependencies of a wing, which must outlive it.
struct WingServices {
  const store::DataFolder& folder;
  store::BlobStore& blobs;
  store::VolumeStore& volumes;
  store::JobStore& jobs;
  jobs::VolumeLibrary& library;
  jobs::LabelLists& labels;
  store::SqlDatabase& records;  // with the wing's own tables
  store::AuditTrail& audit;
  std::function<store::Time()> believed_now;
  // Makes this process the one that does the wing's work, and tells in a transaction whether it
  // is; see RecordStores.
  std::function<std::string()> keep_task;
  std::function<bool(store::SqlConnection&)> has_task;
};

// Each file with the setting that names it; a path may be empty.
using ConfiguredFiles = std::vector<std::pair<std::string, std::filesystem::path>>;

// Thread safe where said.
class Wing {
 public:
  virtual ~Wing() = default;

  // True if it is configured. Its routes exist in any case, and otherwise fail with that reason.
  virtual bool is_open() const = 0;

  virtual void add_routes(App& app) = 0;

  // True if the work with that id has ended, so that requests need not wait for it; empty if the
  // wing has no such work. Thread safe.
  virtual std::optional<bool> has_ended(const std::string& id) const = 0;

  // Sets the listener for ended work, which is called on the thread that ended it.
  virtual void on_end(std::function<void(const std::string& id)> listener) = 0;

  // Tells that a job has ended; the wing may wait for it. Thread safe.
  virtual void job_ended(const std::string& job) = 0;

  // Thread safe.
  virtual std::vector<MeasuredFamily> measure() const = 0;

  // Accepts no new work from outside.
  virtual void begin_drain() = 0;

  // Aborts running work; the next process continues it.
  virtual void stop() = 0;
};

// How the daemon gets a wing.
struct WingEntry {
  // The option that names the configuration file, without dashes, and its help.
  std::string option;
  std::string help;
  std::vector<store::Schema> tables = {};
  // Returns the files that the configuration names. Throws Error kInvalidParameter if that is
  // invalid. Has no side effects.
  std::function<ConfiguredFiles(const std::filesystem::path& file)> check;
  // Without a file, the wing is not open. Returns null if the build has none. Throws as `check`
  // does, and Error kUnavailable if the wing cannot begin.
  std::function<std::unique_ptr<Wing>(const WingSettings&, const WingServices&)> open;
};

}  // namespace isomesh::http
