// A part of the service that a build can leave out: what it adds to the rest.
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
#include "server/store/audit_trail.h"
#include "server/store/blob_store.h"
#include "server/store/expiry.h"
#include "server/store/files/data_folder.h"
#include "server/store/job_store.h"
#include "server/store/order_store.h"
#include "server/store/received_store.h"
#include "server/store/volume_store.h"

namespace isomesh::http {

struct App;

struct WingSettings {
  std::filesystem::path file;  // what it is configured by; empty: it is not
  std::uint64_t max_upload_bytes = 0;
  std::chrono::hours keep{30 * 24};  // what it has done
  // The programs of this installation. Throws Error kInternal when one is missing.
  std::function<std::filesystem::path(const std::string& name)> program;
};

// What it works with, which must outlive it.
struct WingServices {
  const store::DataFolder& folder;
  store::BlobStore& blobs;
  store::VolumeStore& volumes;
  store::JobStore& jobs;
  jobs::VolumeLibrary& library;
  jobs::LabelLists& labels;
  store::OrderStore& orders;
  store::AuditTrail& audit;
  store::ReceivedStore& received;
  std::function<store::Time()> believed_now;
};

// Files by the settings that name them; a name may be empty.
using ConfiguredFiles = std::vector<std::pair<std::string, std::filesystem::path>>;

// Thread safe where said.
class Wing {
 public:
  virtual ~Wing() = default;

  // Whether it is configured. Its routes are there in any case, and say so.
  virtual bool is_open() const = 0;

  virtual void add_routes(App& app) = 0;

  // Whether what has that id has ended, which requests wait for; empty when the wing has nothing of
  // that id. Thread safe.
  virtual std::optional<bool> has_ended(const std::string& id) const = 0;

  // Has `listener` called with the id of whatever ends, by the thread that ends it.
  virtual void on_end(std::function<void(const std::string& id)> listener) = 0;

  // A job has ended: the wing may wait for it. Thread safe.
  virtual void job_ended(const std::string& job) = 0;

  // Thread safe.
  virtual std::vector<MeasuredFamily> measure() const = 0;

  // Nothing new is accepted from outside.
  virtual void begin_drain() = 0;

  // Cuts off what is under way; the next process goes on with it.
  virtual void stop() = 0;
};

}  // namespace isomesh::http
