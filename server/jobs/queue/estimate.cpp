#include "server/jobs/queue/estimate.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "proto/json.h"
#include "server/codec/formats.h"
#include "server/jobs/library/intact_volume.h"
#include "server/jobs/library/label_samples.h"
#include "server/jobs/making/crop.h"
#include "server/jobs/making/mesh_cost.h"
#include "server/jobs/making/stage_times.h"

namespace isomesh::jobs {
namespace {

// The model learns from this many of the most recent finished jobs.
constexpr std::size_t kJobsLookedAt = 50;

// A file of labels contains each label's own surface, so a triangle between two labels is in both.
SurfaceSize surface_in_files(const CountedSurface& counted) {
  if (counted.labels.empty()) return counted.size;
  SurfaceSize all;
  for (const Estimate::Label& label : counted.labels) all.triangles += label.triangles;
  all.vertices = all.triangles / 2;
  return all;
}

SurfaceSize surface_in_files(const MeshSummary& mesh) {
  CountedSurface counted = {.size = {mesh.triangles, mesh.vertices}};
  for (const LabelSummary& label : mesh.labels) {
    counted.labels.push_back({label.label, label.triangles});
  }
  return surface_in_files(counted);
}

// A key of what determines the surface of a volume, and whether cavities are searched in it,
// besides iso-value, scheme and whether it is closed.
std::string key_of_part(const MeshParameters& parameters) {
  MeshParameters part;
  part.regularize = is_regularized(parameters);
  part.inside = parameters.inside;
  const bool is_whole = !parameters.labels && !parameters.crop;
  // Both have cavities searched.
  part.fill_cavities = parameters.fill_cavities || !parameters.components.keeps_all();
  const bool is_plain = !part.regularize && !part.fill_cavities;
  if (is_whole && is_plain && part.inside == Inside::kAbove) return {};
  // The positions of crossings decide which of them are joined.
  if (part.regularize) part.interpolation = parameters.interpolation;
  part.crop = parameters.crop;
  part.labels = parameters.labels;
  part.background = parameters.background;
  part.label_values = parameters.label_values;
  return to_json(part);
}

}  // namespace

void CostModel::learn(const Job& job, const VolumeSize& volume) {
  if (!job.mesh || job.timing.encode <= 0) return;
  const SurfaceSize surface = {job.mesh->triangles, job.mesh->vertices};
  const auto add = [](Correction& correction, double seen, double guessed) {
    correction.seen += seen;
    correction.guessed += guessed;
  };
  SurfaceSize extracted = surface;
  if (job.mesh->simplified) {
    extracted.triangles = job.mesh->simplified->triangles_before;
    extracted.vertices = extracted.triangles / 2;
  }
  const Timing guessed = stage_times(extracted, surface, volume, job.parameters, job.parameters);
  for (std::size_t n = 0; n < kStages.size(); ++n) {
    const auto elapsed = kStages[n].elapsed;
    if (elapsed == nullptr) continue;
    // Jobs that a busy machine made many times slower say little about others.
    constexpr double kMost = 4;
    const double expected = stages_[n].factor() * guessed.*elapsed;
    add(stages_[n], std::clamp(job.timing.*elapsed, expected / kMost, expected * kMost),
        guessed.*elapsed);
  }
  if (job.mesh->simplified && job.mesh->simplified->bound_by == Simplification::Bound::kError) {
    add(share_, static_cast<double>(surface.triangles),
        static_cast<double>(extracted.triangles) *
            share_within(*job.parameters.max_error_mm, volume.smallest_spacing_mm));
  }
  if (job.mesh->labels_count) return;  // the record does not list their triangles
  const SurfaceSize in_files = surface_in_files(*job.mesh);
  for (const auto& [format, file] : job.mesh->files) {
    add(files_.try_emplace(format, kFewBytes).first->second, static_cast<double>(file.bytes),
        codec::describe(format).bytes(in_files, job.parameters));
  }
}

double CostModel::milliseconds(const SurfaceSize& surface, const SurfaceSize& written,
                               const VolumeSize& volume, const JobParameters& parameters) const {
  const Timing times = stage_times(surface, written, volume, parameters, parameters);
  double sum = 0;
  for (std::size_t n = 0; n < kStages.size(); ++n) {
    const auto elapsed = kStages[n].elapsed;
    if (elapsed != nullptr) sum += stages_[n].factor() * times.*elapsed;
  }
  return sum;
}

SurfaceSize CostModel::simplified(const SurfaceSize& surface, const MeshParameters& parameters,
                                  double spacing_mm) const {
  return simplified_surface(surface, parameters, spacing_mm, share_.factor());
}

std::uint64_t CostModel::file_bytes(MeshFormat format, const SurfaceSize& surface,
                                    const MeshParameters& parameters) const {
  const auto found = files_.find(format);
  const double factor = (found == files_.end() ? kFewBytes : found->second).factor();
  return static_cast<std::uint64_t>(
      std::llround(factor * codec::describe(format).bytes(surface, parameters)));
}

Estimate Estimator::estimate(const store::Viewer& viewer, const JobParameters& parameters) {
  const Volume volume = volumes_.get(viewer, parameters.volume);
  Estimate estimate;
  estimate.volume = volume.id;
  const double iso = parameters.iso.value_or(volume.suggested_iso);
  if (!parameters.labels) estimate.iso = iso;
  estimate.scheme = parameters.scheme;
  const CountedSurface counted = count(viewer, volume, parameters, iso);
  const SurfaceSize& surface = counted.size;
  if (counted.labels.size() <= MeshSummary::kMostListedLabels) {
    estimate.labels = counted.labels;
  } else {
    estimate.labels_count = counted.labels.size();
  }
  estimate.triangles = surface.triangles;
  estimate.vertices = surface.vertices;
  const std::uint64_t samples = std::uint64_t{volume.dims[0]} * volume.dims[1] * volume.dims[2];
  const MemoryUse use = {.of_labels = counted.triangles_of_labels(),
                         .searching_bytes = counted.searching_bytes};
  estimate.memory_bytes = estimate_memory(surface, samples, parameters, parameters, use);
  estimate.memory_bytes +=
      CroppedSamples::most_bytes(parameters, volume.geometry, volume.dims, volume.type);
  estimate.fits = estimate.memory_bytes <= limits_.memory_bytes;
  const CostModel costs = model(viewer);
  const VolumeSize size = VolumeSize::of(volume);
  const double spacing_mm = size.smallest_spacing_mm;
  const bool is_simplified = parameters.max_error_mm || parameters.triangles;
  const SurfaceSize written =
      is_simplified ? costs.simplified(surface, parameters, spacing_mm) : surface;
  if (is_simplified) estimate.simplified_triangles = written.triangles;
  estimate.milliseconds = costs.milliseconds(surface, written, size, parameters);
  SurfaceSize in_files = surface_in_files(counted);
  if (is_simplified) in_files = costs.simplified(in_files, parameters, spacing_mm);
  for (const MeshFormat format : files_of(parameters)) {
    estimate.bytes[format] = costs.file_bytes(format, in_files, parameters);
  }
  const store::QueueDepth depth = jobs_.depth(viewer);
  estimate.queue = {depth.all_queued(), depth.running};
  return estimate;
}

CountedSurface Estimator::count(const store::Viewer& viewer, const Volume& volume,
                                const MeshParameters& parameters, double iso) {
  const auto find = [&] {
    const std::stop_token stop = stop_.get_token();
    const store::LocalBlob file = intact_volume(blobs_, volume.samples, stop);
    const JobOrder order = {.work = JobOrder::Work::kCount,
                            .file = file.path,
                            .volume = volume,
                            .parameters = with_label_samples(parameters, volume),
                            .iso = iso,
                            .memory_bytes = limits_.memory_bytes};
    return make_from_volume(blobs_, volume.samples, stop, [&] {
      const Lock lock(process_mutex_);
      return process_.count(order, stop);
    });
  };
  return *counts_.get({viewer, volume.id, iso, key_of_part(parameters),
                       scheme_of(parameters.scheme), parameters.close},
                      find);
}

CostModel Estimator::model(const store::Viewer& viewer) const {
  CostModel costs;
  std::map<std::string, std::optional<VolumeSize>> sizes;  // empty: not known any more
  for (const Job& job : jobs_.list(viewer, {.state = JobState::kSucceeded}, "", kJobsLookedAt)) {
    const std::string& id = job.parameters.volume;
    const auto [known, is_new] = sizes.try_emplace(id);
    if (is_new) {
      if (const auto volume = volumes_.find(viewer, id)) known->second = VolumeSize::of(*volume);
    }
    if (known->second) costs.learn(job, *known->second);
  }
  return costs;
}

}  // namespace isomesh::jobs
