#include "server/jobs/pipeline.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <vector>

#include "server/jobs/stored_samples.h"
#include "server/mesh/parallel.h"
#include "server/volume/canonical.h"

namespace isomesh::jobs {

void Workspace::trim(std::size_t budget_bytes) {
  const std::size_t held = mesh.positions.capacity_bytes() + mesh.triangles.capacity_bytes();
  if (held > budget_bytes) *this = {};
}

PipelineResult run_pipeline(const Volume& volume, const MeshParameters& parameters,
                            const PipelineLimits& limits, const store::BlobStore& blobs,
                            Workspace& workspace, std::stop_token stop, const Report& report) {
  Progress progress(stop, report);
  progress.enter(Stage::kLoad, kLoadShare, &Timing::load);
  const store::LocalBlob file = stored_samples(blobs, volume.id, stop);
  const volume::CanonicalVolume canonical(file.path);
  canonical.preload();
  const std::uint64_t file_bytes = blobs.size(volume.id).value_or(0);

  // Committed together at the end: a job that ends on the way leaves no file of it.
  std::vector<std::unique_ptr<store::BlobWriter>> writers;
  std::vector<codec::Sink> sinks;
  for (std::size_t i = 0; i < parameters.formats.size(); ++i) {
    store::BlobWriter& writer = *writers.emplace_back(blobs.begin());
    sinks.emplace_back([&writer](std::span<const std::byte> bytes) { writer.write(bytes); });
  }
  const volume::CanonicalHeader& header = canonical.header();
  // Of 64^3 samples; jobs side by side keep the processors busy.
  constexpr std::uint64_t kFewSampleBytes = std::uint64_t{1} << 18;
  std::optional<mesh::OneThread> alone;
  if (header.sample_bytes() <= kFewSampleBytes) alone.emplace();
  // The volume has to be there too.
  const std::uint64_t capacity = blobs.capacity();
  const std::uint64_t disk_bytes = capacity - std::min(capacity, file_bytes);
  PipelineResult result;
  result.mesh = make_mesh({header.type, header.dims, header.geometry, canonical.samples().data()},
                          {volume, parameters, parameters.iso.value_or(volume.suggested_iso),
                           limits.memory_bytes, disk_bytes},
                          sinks, progress, workspace.mesh);
  for (std::size_t i = 0; i < writers.size(); ++i) {
    const store::Blob blob = writers[i]->commit();
    result.mesh.files[parameters.formats[i]] = {blob.bytes, blob.key, ""};
  }
  progress.end_stage();
  result.timing = progress.timing();
  return result;
}

}  // namespace isomesh::jobs
