// One job's way from a stored volume to stored meshes.
#pragma once

#include <cstdint>
#include <stop_token>

#include "proto/types.h"
#include "server/jobs/make_mesh.h"
#include "server/mesh/mesh.h"
#include "server/store/blob_store.h"

namespace isomesh::jobs {

// The memory that a worker's jobs are made in, kept from one to the next so that its pages are
// mapped already. Not thread safe.
struct Workspace {
  mesh::Mesh mesh;

  // Gives memory back when it exceeds `budget_bytes`: one giant job must not keep it for ever.
  void trim(std::size_t budget_bytes);
};

struct PipelineResult {
  MeshSummary mesh;  // the files' hrefs are empty
  Timing timing;     // load, extract, smooth and encode
};

struct PipelineLimits {
  std::uint64_t memory_bytes = std::uint64_t{8} << 30;  // of one job
};

// Changes whenever the same volume and parameters would give other bytes than before.
inline constexpr const char* kMesherVersion = "2";

// Loads the volume's samples, extracts, smooths, encodes in every format and stores the results.
// The mesh is the same to the byte for the same volume and parameters. Throws Error kCancelled
// when `stop` is requested, kTooLarge with the estimate when the job would exceed the limits (told
// before memory is taken), kUnusableVolume when the stored samples are not those of the volume,
// kOutOfSpace or kInternal.
PipelineResult run_pipeline(const Volume& volume, const MeshParameters& parameters,
                            const PipelineLimits& limits, const store::BlobStore& blobs,
                            Workspace& workspace, std::stop_token stop, const Report& report);

}  // namespace isomesh::jobs
