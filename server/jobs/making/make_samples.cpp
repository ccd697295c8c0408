#include "server/jobs/making/make_samples.h"

#include <algorithm>
#include <cstdint>
#include <optional>

#include "proto/samples.h"
#include "server/jobs/making/crop.h"
#include "server/mesh/parallel.h"
#include "server/volume/labels.h"

namespace isomesh::jobs {
namespace {

// The bytes of 64^3 samples. So small a job uses one thread; jobs side by side keep the processors
// busy.
constexpr std::uint64_t kFewSampleBytes = std::uint64_t{1} << 18;

std::uint64_t bytes_of(const SampleArray& samples) {
  const auto& dims = samples.dims;
  return std::uint64_t{dims[0]} * dims[1] * dims[2] * bytes_per_sample(samples.type);
}

}  // namespace

MadeLabels make_from_samples(const SampleArray& samples, const MeshRequest& request,
                             std::span<const codec::Sink> sinks, Progress& progress,
                             Workspace& workspace) {
  std::optional<mesh::OneThread> alone;
  if (bytes_of(samples) <= kFewSampleBytes) alone.emplace();
  const CroppedSamples cropped(samples, request.parameters);
  Volume volume = request.volume;
  if (cropped.is_rounded()) volume.notes.push_back(volume::rounded_note(samples.type));
  const std::uint64_t memory_bytes =
      request.memory_bytes - std::min(request.memory_bytes, cropped.bytes());
  const MeshRequest own = {.volume = volume,
                           .parameters = request.parameters,
                           .iso = request.iso,
                           .measures = request.measures,
                           .memory_bytes = memory_bytes,
                           .disk_bytes = request.disk_bytes,
                           .spool = request.spool};
  if (request.parameters.labels) {
    return make_labels(cropped.array(), own, sinks, progress, workspace.walls);
  }
  return {.summary = make_mesh(cropped.array(), own, sinks, progress, workspace.mesh), .walls = {}};
}

}  // namespace isomesh::jobs
