#include "server/jobs/queue/workers.h"

#include <algorithm>
#include <exception>
#include <new>
#include <optional>
#include <utility>

#include <unistd.h>

#include "base/ids.h"
#include "base/log.h"
#include "server/jobs/limits.h"

namespace isomesh::jobs {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

// Why a run was asked to stop.
enum class Reason { kNone, kCancelled, kLost, kTooLong, kEnding };

std::string worker_name(std::size_t thread) {
  return host_name() + ':' + std::to_string(::getpid()) + ':' + std::to_string(thread);
}

// False also if that cannot be found out: something of the machine is missing.
bool responds(const store::BlobStore& blobs) noexcept {
  try {
    return blobs.responds();
  } catch (const std::exception&) {
    return false;
  }
}

}  // namespace

// The machine's fault, if that ended a run: a full disk, or one that will pass soon.
enum class Workers::Fault { kNone, kFullDisk, kOther };

// A running job, shared by its worker and the thread that renews leases. Thread safe.
class Workers::Run {
 public:
  explicit Run(const store::Lease& lease) : lease_(lease) {}

  const store::Lease& lease() const { return lease_; }
  std::stop_token token() const { return stop_.get_token(); }
  Reason reason() const { return reason_; }
  Clock::duration age() const { return Clock::now() - began_; }

  // Later reasons are ignored.
  void stop(Reason reason) {
    Reason none = Reason::kNone;
    reason_.compare_exchange_strong(none, reason);
    stop_.request_stop();
  }

  // Returns true if the stage has changed.
  bool advance(const store::Progress& progress) {
    const Lock lock(mutex_);
    const bool is_other_stage = progress.stage != progress_.stage;
    progress_ = progress;
    return is_other_stage;
  }

  // Renews the lease unless the run is over. Stops the run if it was cancelled or lost its lease.
  void renew(store::JobStore& jobs, milliseconds lease) {
    const Lock renewing(renewal_);
    if (is_over_) return;
    const store::Standing standing = jobs.renew(lease_, progress(), lease);
    if (standing == store::Standing::kCancel) stop(Reason::kCancelled);
    if (standing == store::Standing::kLost) stop(Reason::kLost);
  }

  // Once this returns, no renewal is running and none will start.
  void end() {
    const Lock renewing(renewal_);
    is_over_ = true;
  }

 private:
  store::Progress progress() const {
    const Lock lock(mutex_);
    return progress_;
  }

  const store::Lease lease_;
  const Clock::time_point began_ = Clock::now();
  std::stop_source stop_;
  std::atomic<Reason> reason_ = Reason::kNone;
  mutable Mutex mutex_;
  store::Progress progress_ ISOMESH_GUARDED_BY(mutex_);
  Mutex renewal_;
  bool is_over_ ISOMESH_GUARDED_BY(renewal_) = false;
};

Workers::Workers(const WorkerOptions& options, store::JobStore& jobs,
                 const store::VolumeStore& volumes, store::BlobStore& blobs)
    : options_(options), jobs_(jobs), volumes_(volumes), blobs_(blobs), alive_(options.threads) {
  try {
    for (std::size_t i = 0; i < options.threads; ++i) {
      threads_.emplace_back([this, i] { work(claims_.get_token(), worker_name(i)); });
    }
    leases_ = std::jthread([this](const std::stop_token& stop) { look_after_leases(stop); });
  } catch (...) {
    end_threads();  // otherwise the threads already started would go on
    throw;
  }
}

Workers::~Workers() { end_threads(); }

void Workers::end_threads() {
  claims_.request_stop();
  running_.request_stop();
  threads_.clear();  // leases are renewed until all have ended
}

bool Workers::drain(milliseconds wait) {
  claims_.request_stop();
  Lock lock(alive_mutex_);
  return ended_.wait_for(lock, wait,
                         [this]() ISOMESH_REQUIRES(alive_mutex_) { return alive_ == 0; });
}

void Workers::work(const std::stop_token& stop, const std::string& name) {
  JobProcess process(options_.program);
  // The storage is not asked for nothing: that writes to a disk, or sends a request.
  bool may_have_work = true;
  while (!stop.stop_requested()) {
    try {
      if (!blobs_.has_room() || (may_have_work && !responds(blobs_))) {
        pause(stop, limits::kLongestIdle);
      } else if (const auto lease = jobs_.claim(name, options_.lease)) {
        may_have_work = true;
        run(*lease, process);
      } else {
        may_have_work = jobs_.wait_for_work(stop, limits::kLongestIdle);
      }
    } catch (const std::exception& error) {
      log_error("the queue cannot be read and is retried: {}", error.what());
      pause(stop, limits::kLongestIdle);
    }
  }
  const Lock lock(alive_mutex_);
  --alive_;
  ended_.notify_all();
}

void Workers::run(const store::Lease& lease, JobProcess& process) {
  const auto run = std::make_shared<Run>(lease);
  {
    const Lock lock(runs_mutex_);
    runs_.push_back(run);
  }
  const std::stop_callback on_end(running_.get_token(), [&] { run->stop(Reason::kEnding); });
  const std::string path = "/v1/jobs/" + lease.id;
  store::Outcome outcome;
  Fault fault = Fault::kNone;
  try {
    const Volume volume = volumes_.get(lease.owner, lease.parameters.volume);
    PipelineResult result = run_pipeline(
        volume, lease.parameters, options_.limits, blobs_, process, run->token(),
        [&](Stage stage, double share, const Timing& so_far) {
          if (run->advance({stage, share, so_far})) renew(*run);
        },
        lease.owner);
    outcome.mesh = std::move(result.mesh);
    outcome.timing = result.timing;
  } catch (const ProcessEnded& end) {
    outcome.error = to_problem(end, path);
    outcome.error->detail = end.what();  // about the job, not the service, so clients may see it
    outcome.may_retry = true;
    log_error("job {}, attempt {} failed: {}", lease.id, lease.attempt, end.what());
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kOutOfSpace) fault = Fault::kFullDisk;
    // While the storage is missing, an internal error is the storage's.
    const bool is_internal = error.code() == ErrorCode::kInternal;
    if (error.code() == ErrorCode::kUnavailable || (is_internal && !responds(blobs_))) {
      fault = Fault::kOther;
    }
    if (error.code() != ErrorCode::kCancelled) {
      if (fault == Fault::kNone) outcome.error = to_problem(error, path);
      outcome.may_retry = is_internal;
      log_error("job {}, attempt {} failed: {}", lease.id, lease.attempt, error.what());
    }
  } catch (const std::bad_alloc&) {
    // The service is out of memory, not the job.
    fault = Fault::kOther;
    log_error("job {}, attempt {} failed: the service is out of memory", lease.id, lease.attempt);
  } catch (const std::exception& error) {
    outcome.error = to_problem({ErrorCode::kInternal, error.what()}, path);
    outcome.may_retry = true;
    log_error("job {}, attempt {} failed: {}", lease.id, lease.attempt, error.what());
  }
  run->end();
  {
    const Lock lock(runs_mutex_);
    std::erase(runs_, run);
    if (fault != Fault::kFullDisk) full_disk_delays_.erase(lease.id);
  }
  conclude(*run, fault, outcome);
}

// Records how the run ended. Retries if the database has no space or does not respond.
void Workers::conclude(const Run& run, Fault fault, store::Outcome outcome) {
  const store::Lease& lease = run.lease();
  // Also with a fault of the machine: a run that was to stop may meet one before it ends.
  const bool was_stopped = !outcome.mesh && !outcome.error && run.reason() != Reason::kNone;
  if (was_stopped && run.reason() == Reason::kTooLong) {
    const std::string minutes = std::to_string(options_.longest_job.count());
    outcome.error = to_problem(
        {ErrorCode::kTooLarge, "the job took longer than the " + minutes + " minutes allowed"},
        "/v1/jobs/" + lease.id);
  }
  const auto tell = [&] {
    // Finishing without a result would cancel the job if the lease were valid after all.
    if (was_stopped && run.reason() == Reason::kLost) return false;
    if (was_stopped && run.reason() == Reason::kEnding) {
      return jobs_.put_back(lease, milliseconds(0));
    }
    if (!was_stopped && fault == Fault::kFullDisk) {
      const milliseconds delay = full_disk_delay(lease.id);
      log_warning("job {} waits {} s for disk space", lease.id, delay.count() / 1000);
      return jobs_.put_back(lease, delay, WaitingFor::kDisk);
    }
    if (!was_stopped && fault == Fault::kOther)
      return jobs_.put_back(lease, limits::kExhaustedDelay);
    return jobs_.finish(lease, outcome);
  };
  while (true) {
    try {
      if (!tell()) log_warning("job {} lost its lease; its result is discarded", lease.id);
      return;
    } catch (const Error& error) {
      const bool may_pass =
          error.code() == ErrorCode::kOutOfSpace || error.code() == ErrorCode::kUnavailable;
      if (!may_pass || running_.stop_requested()) throw;
      log_error("the end of job {} could not be recorded and is retried: {}", lease.id,
                error.what());
    }
    pause(running_.get_token(), limits::kEndRetry);
  }
}

// Kept in memory only: after a restart the job is retried soon.
milliseconds Workers::full_disk_delay(const std::string& job) {
  const Lock lock(runs_mutex_);
  milliseconds& next = full_disk_delays_.try_emplace(job, limits::kFullDiskDelay).first->second;
  const milliseconds delay = next;
  next = std::min(2 * next, limits::kLongestFullDiskDelay);
  return delay;
}

void Workers::renew(Run& run) {
  try {
    run.renew(jobs_, options_.lease);
  } catch (const std::exception& error) {
    log_error("the lease of job {} could not be renewed: {}", run.lease().id, error.what());
  }
}

void Workers::look_after_leases(const std::stop_token& stop) {
  auto last_reap = Clock::now();
  while (!stop.stop_requested()) {
    std::vector<std::shared_ptr<Run>> runs;
    {
      const Lock lock(runs_mutex_);
      runs = runs_;
    }
    for (const auto& run : runs) {
      if (run->age() > options_.longest_job) run->stop(Reason::kTooLong);
      renew(*run);
    }
    if (Clock::now() - last_reap > limits::kBetweenReaps) {
      last_reap = Clock::now();
      reap();
    }
    pause(stop, limits::kBetweenRenewals);
  }
}

void Workers::reap() {
  try {
    if (const std::size_t count = jobs_.reap())
      log_warning("{} leases expired; their jobs are run again", count);
  } catch (const std::exception& error) {
    log_error("expired leases could not be released and are retried: {}", error.what());
  }
}

}  // namespace isomesh::jobs
