#include "server/http/guards/read_trail.h"

#include <algorithm>
#include <iterator>
#include <string_view>
#include <utility>

#include "base/log.h"
#include "proto/error.h"

namespace isomesh::http {
namespace {

// Windows that are open at the same time; beyond it, all are closed early.
constexpr std::size_t kMostWindows = 10'000;
// Counts that wait because the trail cannot be written to.
constexpr std::size_t kMostCounts = 10'000;

constexpr int kUnauthorized = 401;
constexpr int kNotAllowed = 403;

bool is_read(int status) {
  return (status >= 200 && status < 300) || status == 304 || status == 307;
}

// Answers to requests for data that may exist and that the caller may not read.
bool is_refused(int status) { return status == 403 || status == 404 || status == 410; }

bool is_transfer(std::string_view what) {
  return what == "slice" || what == "preview" || what == "mesh";
}

// The record, or empty if there is none.
template <class Get>
auto record_of(const Get& get) -> std::optional<decltype(get())> {
  try {
    return get();
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kNotFound && error.code() != ErrorCode::kGone) throw;
    return std::nullopt;
  }
}

}  // namespace

ReadTrail::ReadTrail(const Stores& stores, std::chrono::milliseconds window)
    : stores_(stores), window_(window), closing_([this](const std::stop_token& stop) {
        const std::chrono::milliseconds between = std::max(window_ / 10, decltype(window_)(1));
        while (!stop.stop_requested()) {
          pause(stop, between);
          {
            const Lock lock(mutex_);
            close_windows(Clock::now());
          }
          enter_counts(stop);
        }
      }) {}

ReadTrail::~ReadTrail() {
  is_ending_ = true;
  closing_.request_stop();
  closing_.join();
  {
    const Lock lock(mutex_);
    close_windows(Clock::time_point::max());
  }
  enter_counts({});
  const std::uint64_t refused = refusals_.end() + restrictions_.end();
  const Lock lock(mutex_);
  if (counts_.empty() && refused == 0) return;
  log_error("the audit trail lacks {} counts of readings and {} refused requests", counts_.size(),
            refused);
}

// Every route below a volume or a job tells about its patient, except a job's state and events.
std::optional<ReadTrail::Reading> ReadTrail::reading_of(const Request& request,
                                                        const Response& response) {
  constexpr std::string_view kVolume = "/v1/volumes/{id}";
  constexpr std::string_view kJob = "/v1/jobs/{id}";
  const std::string_view route = request.context.route;
  // These respond with the volume and its patient.
  const bool has_details = (request.method == "PATCH" && route == "/v1/volumes/{id}") ||
                           (request.method == "POST" && route == "/v1/volumes/{id}/reoriented");
  if (request.method != "GET" && request.method != "HEAD" && !has_details) return std::nullopt;
  if (!is_read(response.status) && !is_refused(response.status)) return std::nullopt;
  if (response.told) {
    return Reading{.caller = request.context.caller.name,
                   .address = request.remote_address,
                   .id = {},
                   .what = response.told->what,
                   .success = is_read(response.status),
                   .told = response.told};
  }
  const bool is_of_job = route.starts_with(kJob);
  if (!is_of_job && !route.starts_with(kVolume)) return std::nullopt;
  std::string_view what = route.substr((is_of_job ? kJob : kVolume).size());
  if (is_of_job && (what.empty() || what == "/events")) return std::nullopt;
  what = what.empty() || has_details ? "volume" : what.substr(1);
  return Reading{.caller = request.context.caller.name,
                 .address = request.remote_address,
                 .is_of_job = is_of_job,
                 .id = request.path_parameter("id"),
                 .what = std::string(what.substr(0, what.find('.'))),
                 .success = is_read(response.status)};
}

std::optional<store::AuditEntry> ReadTrail::entry_of(const Reading& reading) const {
  store::AuditEntry entry = {.event = is_transfer(reading.what) ? store::AuditEvent::kTransferred
                                                                : store::AuditEvent::kQuery,
                             .success = reading.success,
                             .peer = reading.address,
                             .caller = reading.caller,
                             .what = reading.what,
                             .volume = reading.id,
                             .requests = 1};
  if (is_transfer(reading.what)) entry.direction = "out";
  if (reading.told) {
    entry.study = reading.told->study;
    entry.patient_id = reading.told->patient_id;
    return entry;
  }
  if (reading.is_of_job) {
    const auto job = record_of([&] { return stores_.jobs.get(store::Viewer(), reading.id); });
    if (!job) return std::nullopt;
    entry.job = reading.id;
    entry.volume = job->parameters.volume;
  }
  const auto volume = stores_.volumes.find(store::Viewer(), entry.volume);
  // The mesh of a volume that is gone or damaged may have a patient; earlier entries name them.
  if (!volume) return reading.is_of_job ? std::optional(entry) : std::nullopt;
  if (!volume->dicom) return std::nullopt;
  entry.study = volume->dicom->study_uid;
  entry.patient_id = volume->dicom->patient_id;
  return entry;
}

bool ReadTrail::add(const store::AuditEntry& entry) {
  if (gives_up_) return false;
  try {
    stores_.audit.add(entry);
    return true;
  } catch (const std::exception& error) {
    log_error("the audit trail cannot be written to: {}", error.what());
    gives_up_ = is_ending_.load();
    return false;
  }
}

void ReadTrail::close(Windows::iterator window) {
  auto& [end, entry, counted, is_open] = window->second;
  if (entry && counted > 0) {
    entry->requests = counted;
    if (counts_.size() < kMostCounts) {
      counts_.push_back(*std::move(entry));
    } else {
      log_error("the audit trail lacks a count of readings: too many wait for it");
    }
  }
  windows_.erase(window);
}

void ReadTrail::close_windows(Clock::time_point until) {
  for (auto window = windows_.begin(); window != windows_.end();) {
    const auto next = std::next(window);
    if (window->second.is_open && window->second.end <= until) close(window);
    window = next;
  }
}

void ReadTrail::enter_counts(const std::stop_token& stop) {
  Lock lock(mutex_);
  while (!counts_.empty() && !stop.stop_requested()) {
    const store::AuditEntry entry = counts_.front();
    lock.unlock();
    const bool is_entered = add(entry);
    lock.lock();
    counts_.pop_front();
    if (is_entered) continue;
    counts_.push_back(entry);  // the others do not wait for one that can never be entered
    return;
  }
}

Throttle<store::AuditEntry>::Tell ReadTrail::adder() {
  return [this](store::AuditEntry entry, std::uint64_t others) {
    entry.unlisted = others;
    return add(entry);
  };
}

void ReadTrail::enter_first(const Reading& reading) {
  Window window = {.is_open = true};
  bool is_entered = false;
  try {
    window.entry = entry_of(reading);
    is_entered = !window.entry || add(*window.entry);
  } catch (const std::exception& error) {
    log_error("the audit trail has no entry for a reading: {}", error.what());
  }
  const Lock lock(mutex_);
  window.end = Clock::now() + window_;
  if (is_entered) {
    windows_[reading] = std::move(window);
  } else {
    windows_.erase(reading);
  }
  entered_.notify_all();
}

void ReadTrail::note(const Request& request, const Response& response) {
  using store::AuditEvent;
  const auto refused = [&](AuditEvent event, const char* what) {
    return store::AuditEntry{.event = event,
                             .success = false,
                             .peer = request.remote_address,
                             .caller = request.context.caller.name,
                             .what = what};
  };
  if (response.status == kUnauthorized) {
    return refusals_.add(refused(AuditEvent::kAuthenticationFailure, "login"));
  }
  const auto reading = reading_of(request, response);
  // Only a login has a name: pages of other origins are rejected before they log in.
  if (!reading && response.status == kNotAllowed && !request.context.caller.name.empty()) {
    return restrictions_.add(refused(AuditEvent::kRestricted, "permission"));
  }
  if (!reading) return;
  Lock lock(mutex_);
  auto found = windows_.find(*reading);
  if (found != windows_.end() && !found->second.is_open) {
    // No response to the same reading is sent before its entry is written. If that fails, it is
    // logged once for all of them.
    entered_.wait(lock, [&]() ISOMESH_REQUIRES(mutex_) {
      found = windows_.find(*reading);
      return found == windows_.end() || found->second.is_open;
    });
    if (found == windows_.end()) return;
  }
  if (found != windows_.end() && Clock::now() < found->second.end) {
    ++found->second.counted;
    return;
  }
  if (found != windows_.end()) close(found);
  if (windows_.size() >= kMostWindows) close_windows(Clock::time_point::max());
  windows_[*reading] = {};
  lock.unlock();
  enter_first(*reading);
}

}  // namespace isomesh::http
