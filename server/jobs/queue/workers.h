#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "base/mutex.h"
#include "server/jobs/queue/pipeline.h"
#include "server/store/blob_store.h"
#include "server/store/job_store.h"
#include "server/store/volume_store.h"

namespace isomesh::jobs {

struct WorkerOptions {
  std::size_t threads = 2;
  JobProgram program = {};
  PipelineLimits limits = {};
  std::chrono::milliseconds lease{30'000};  // a dead worker's job runs again after this
  std::chrono::minutes longest_job{60};     // longer jobs fail
};

// Threads that run jobs, one job at a time each; each thread keeps one process. A further thread
// renews their leases and reaps expired ones. The stores must outlive it. Thread safe.
class Workers {
 public:
  Workers(const WorkerOptions& options, store::JobStore& jobs, const store::VolumeStore& volumes,
          store::BlobStore& blobs);

  // Stops running jobs and puts them back into the queue. Returns once all threads have ended.
  ~Workers();

  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  // Starts no further jobs. Returns once no job runs or `wait` has passed; true if none runs.
  bool drain(std::chrono::milliseconds wait);

 private:
  class Run;
  enum class Fault;

  void work(const std::stop_token& stop, const std::string& name);
  void run(const store::Lease& lease, JobProcess& process);
  void conclude(const Run& run, Fault fault, store::Outcome outcome);
  std::chrono::milliseconds full_disk_delay(const std::string& job);
  void renew(Run& run);
  void look_after_leases(const std::stop_token& stop);
  void reap();
  void end_threads();

  const WorkerOptions options_;
  store::JobStore& jobs_;
  const store::VolumeStore& volumes_;
  store::BlobStore& blobs_;
  std::stop_source claims_;   // stops claiming jobs
  std::stop_source running_;  // interrupts running jobs
  Mutex alive_mutex_;
  Condition ended_;
  std::size_t alive_ ISOMESH_GUARDED_BY(alive_mutex_);  // threads that may still run a job
  Mutex runs_mutex_;
  std::vector<std::shared_ptr<Run>> runs_ ISOMESH_GUARDED_BY(runs_mutex_);  // the running jobs
  // The next delay of each job that waits for disk space.
  std::map<std::string, std::chrono::milliseconds> full_disk_delays_
      ISOMESH_GUARDED_BY(runs_mutex_);
  std::vector<std::jthread> threads_;
  std::jthread leases_;  // last: joined first
};

}  // namespace isomesh::jobs
