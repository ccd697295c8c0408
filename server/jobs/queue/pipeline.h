// Processes one job from a stored volume to stored meshes: the daemon's side. A process used by
// this job alone reads the samples.
#pragma once

#include <cstdint>
#include <stop_token>
#include <string>

#include "proto/types.h"
#include "server/jobs/making/make_mesh.h"
#include "server/jobs/queue/job_process.h"
#include "server/store/blob_store.h"

namespace isomesh::jobs {

struct PipelineResult {
  MeshSummary mesh;  // the hrefs of its files are empty
  Timing timing;     // load, extract, smooth and encode
};

struct PipelineLimits {
  std::uint64_t memory_bytes = std::uint64_t{8} << 30;  // of one job
};

// Increment with codec::kMesherVersion, and whenever jobs can ask for something new: in an upgrade,
// the older daemons that share the queue leave newer jobs to newer daemons.
inline constexpr int kJobVersion = 10;

// Lets `process` load the samples, extract, smooth and encode in every format, and stores the
// results as data of `owner`. The same volume and parameters give the same bytes. Throws Error
// kCancelled if `stop` is requested; kTooLarge with the estimate if the job would exceed the limits
// (before it allocates memory); kUnusableVolume if the stored samples are corrupt; kOutOfSpace,
// kInternal, and ProcessEnded.
PipelineResult run_pipeline(const Volume& volume, const JobParameters& parameters,
                            const PipelineLimits& limits, store::BlobStore& blobs,
                            JobProcess& process, std::stop_token stop, const Report& report,
                            const std::string& owner = "");

}  // namespace isomesh::jobs
