// One job's way from a stored volume to stored meshes: the daemon's part of it. The samples are
// looked at by a process that the job has for itself.
#pragma once

#include <cstdint>
#include <stop_token>

#include "proto/types.h"
#include "server/jobs/making/make_mesh.h"
#include "server/jobs/queue/job_process.h"
#include "server/store/blob_store.h"

namespace isomesh::jobs {

struct PipelineResult {
  MeshSummary mesh;  // the files' hrefs are empty
  Timing timing;     // load, extract, smooth and encode
};

struct PipelineLimits {
  std::uint64_t memory_bytes = std::uint64_t{8} << 30;  // of one job
};

// Changes whenever the same volume and parameters would give other bytes than before.
inline constexpr const char* kMesherVersion = "9";

// Has `process` load the volume's samples, extract, smooth and encode in every format, and stores
// the results. The mesh is the same to the byte for the same volume and parameters. Throws Error
// kCancelled when `stop` is requested, kTooLarge with the estimate when the job would exceed the
// limits (told before memory is taken), kUnusableVolume when the stored samples are not those of
// the volume, kOutOfSpace or kInternal, and ProcessEnded.
PipelineResult run_pipeline(const Volume& volume, const JobParameters& parameters,
                            const PipelineLimits& limits, const store::BlobStore& blobs,
                            JobProcess& process, std::stop_token stop, const Report& report);

}  // namespace isomesh::jobs
