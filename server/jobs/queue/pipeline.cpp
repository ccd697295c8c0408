#include "server/jobs/queue/pipeline.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <span>
#include <vector>

#include "proto/empty_surface.h"
#include "server/jobs/library/intact_volume.h"
#include "server/jobs/library/label_samples.h"
#include "server/jobs/making/stage_times.h"

namespace isomesh::jobs {
namespace {

using Clock = std::chrono::steady_clock;

double milliseconds_since(Clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}

// Disk capacity for the files, excluding the volume's own bytes.
std::uint64_t disk_for_files(const store::BlobStore& blobs, const Volume& volume) {
  const std::uint64_t capacity = blobs.capacity();
  return capacity - std::min(capacity, blobs.size(volume.samples).value_or(0));
}

}  // namespace

PipelineResult run_pipeline(const Volume& volume, const JobParameters& parameters,
                            const PipelineLimits& limits, store::BlobStore& blobs,
                            JobProcess& process, std::stop_token stop, const Report& report,
                            const std::string& owner) {
  const auto began = Clock::now();
  report(Stage::kLoad, 0, {});
  const store::LocalBlob file = intact_volume(blobs, volume.samples, stop);
  const double checking = milliseconds_since(began);

  // All are committed at the end, so an unfinished job leaves no files.
  std::vector<std::unique_ptr<store::BlobWriter>> writers;
  std::vector<codec::Sink> sinks;
  const std::vector<MeshFormat> files = files_of(parameters);
  // Two more than files: for the list of labels, if it is long, and for that of walls.
  for (std::size_t i = 0; i < files.size() + 2; ++i) {
    store::BlobWriter& writer = *writers.emplace_back(blobs.begin(owner));
    sinks.emplace_back([&writer](std::span<const std::byte> bytes) { writer.write(bytes); });
  }
  const auto with_checking = [&](Timing timing) {
    timing.load += checking;
    return timing;
  };
  const auto pass_on = [&](Stage stage, double share, const Timing& timing) {
    report(stage, share, with_checking(timing));
  };
  const JobOrder order = {.file = file.path,
                          .volume = volume,
                          .parameters = with_label_samples(parameters, volume),
                          .iso = parameters.iso.value_or(volume.suggested_iso),
                          .measures = parameters,
                          .memory_bytes = limits.memory_bytes,
                          .disk_bytes = disk_for_files(blobs, volume),
                          .expected = expected_times(volume, parameters, parameters)};
  MadeMesh made = make_from_volume(blobs, volume.samples, stop,
                                   [&] { return process.make(order, sinks, stop, pass_on); });
  const auto stored = Clock::now();
  PipelineResult result = {std::move(made.summary), with_checking(made.timing)};
  if (result.mesh.empty) {
    result.mesh.empty_reason =
        why_empty(parameters, result.mesh, {volume.range, volume.suggested_iso});
  }
  for (std::size_t i = 0; i < files.size(); ++i) {
    const store::Blob blob = writers[i]->commit(stop);
    result.mesh.files[files[i]] = {blob.bytes, blob.key, ""};
  }
  const auto list_in = [&](store::BlobWriter& writer) {
    const store::Blob blob = writer.commit(stop);
    return LabelListFile{blob.bytes, blob.key};
  };
  if (result.mesh.labels_count) result.mesh.label_list = list_in(*writers[files.size()]);
  if (result.mesh.walls_count.value_or(0) > 0) result.mesh.wall_list = list_in(*writers.back());
  result.timing.encode += milliseconds_since(stored);
  report(Stage::kEncode, 1, result.timing);
  return result;
}

}  // namespace isomesh::jobs
