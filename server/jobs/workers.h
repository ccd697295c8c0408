#pragma once

#include <atomic>
#include <chrono>
#include <stop_token>
#include <thread>
#include <vector>

#include "server/jobs/pipeline.h"
#include "server/store/blob_store.h"
#include "server/store/job_store.h"
#include "server/store/volume_store.h"

namespace isomesh::jobs {

// The threads that run jobs, one job each at a time; the kernels' own threads are shared between
// them. The stores must outlive it. Thread safe.
class Workers {
 public:
  Workers(std::size_t threads, store::JobStore& jobs, const store::VolumeStore& volumes,
          const store::BlobStore& blobs, const PipelineLimits& limits);

  // Running jobs are stopped and put back; returns when all threads have ended.
  ~Workers();

  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  // No job is begun any more; returns when no job runs or `wait` is over. True when none runs.
  bool drain(std::chrono::milliseconds wait);

 private:
  void work(const std::stop_token& stop);
  void run(const store::Lease& lease, Workspace& workspace);

  store::JobStore& jobs_;
  const store::VolumeStore& volumes_;
  const store::BlobStore& blobs_;
  const PipelineLimits limits_;
  std::stop_source claims_;            // ends the taking of jobs
  std::stop_source running_;           // interrupts those that run
  std::atomic<std::size_t> alive_;     // threads that may still run a job
  std::vector<std::jthread> threads_;  // last: joined first
};

}  // namespace isomesh::jobs
