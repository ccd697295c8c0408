// Enters into the audit trail who reads the data of patients, whose token was refused, and who
// tried what the token does not allow.
#pragma once

#include <atomic>
#include <chrono>
#include <compare>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <thread>

#include "base/mutex.h"
#include "base/throttle.h"
#include "server/http/requests/request.h"
#include "server/http/requests/response.h"
#include "server/store/audit/trail.h"
#include "server/store/job_store.h"
#include "server/store/volume_store.h"

namespace isomesh::http {

// A view of a volume requests a hundred slices. The first request of a caller for one kind of data
// of one volume or job is entered before its response is sent; the requests within a window after
// it are counted, and entered as one number when the window ends. If the process is killed, only
// such a number is lost. Data of volumes that did not come as DICOM is not entered, but the mesh of
// an erased volume is, without its patient. Thread safe.
class ReadTrail {
 public:
  struct Stores {
    store::AuditTrail& audit;
    const store::VolumeStore& volumes;
    const store::JobStore& jobs;
  };

  // The stores must outlive this object.
  explicit ReadTrail(const Stores& stores,
                     std::chrono::milliseconds window = std::chrono::minutes(10));
  // Enters what was counted.
  ~ReadTrail();
  ReadTrail(const ReadTrail&) = delete;
  ReadTrail& operator=(const ReadTrail&) = delete;

  // Call with every response before it is sent. Does not throw: a trail that cannot be written to
  // is logged, because physicians need their images nevertheless.
  void note(const Request& request, const Response& response) ISOMESH_EXCLUDES(mutex_);

 private:
  using Clock = std::chrono::steady_clock;

  struct Reading {
    std::string caller;
    std::string address;
    bool is_of_job = false;
    std::string id;    // of the volume or the job
    std::string what;  // "volume", "slice", "mesh", ...
    bool success = true;
    std::optional<ToldPatient> told = {};

    auto operator<=>(const Reading&) const = default;
  };

  struct Window {
    Clock::time_point end = {};
    std::optional<store::AuditEntry> entry = {};  // empty if there is no patient
    std::uint64_t counted = 0;                    // requests since the entry
    bool is_open = false;                         // otherwise its first reading is being entered
  };

  using Windows = std::map<Reading, Window>;

  static std::optional<Reading> reading_of(const Request& request, const Response& response);
  // Empty if there is no patient.
  std::optional<store::AuditEntry> entry_of(const Reading& reading) const;
  // Enters the first reading of a window, and opens the window.
  void enter_first(const Reading& reading) ISOMESH_EXCLUDES(mutex_);
  // Returns false if the trail cannot be written to, which may take seconds to find out. So at the
  // end nothing more is tried after a failure.
  bool add(const store::AuditEntry& entry);
  // Closes the windows that have ended by then. Their counts are entered later, by a thread that no
  // response waits for.
  void close_windows(Clock::time_point until) ISOMESH_REQUIRES(mutex_);
  void close(Windows::iterator window) ISOMESH_REQUIRES(mutex_);
  // Enters the counts, up to the first that cannot be entered, which becomes the last.
  void enter_counts(const std::stop_token& stop) ISOMESH_EXCLUDES(mutex_);
  Throttle<store::AuditEntry>::Tell adder();

  const Stores stores_;
  const std::chrono::milliseconds window_;
  std::atomic<bool> is_ending_ = false;
  std::atomic<bool> gives_up_ = false;
  // Strangers could fill the trail otherwise.
  Throttle<store::AuditEntry> refusals_{std::chrono::seconds(1), adder()};
  Throttle<store::AuditEntry> restrictions_{std::chrono::seconds(1), adder()};
  Mutex mutex_;
  Condition entered_;
  Windows windows_ ISOMESH_GUARDED_BY(mutex_);
  std::deque<store::AuditEntry> counts_ ISOMESH_GUARDED_BY(mutex_);  // of closed windows
  std::jthread closing_;                                             // last: uses the other members
};

}  // namespace isomesh::http
