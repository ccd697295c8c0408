#include "server/jobs/mesh_stages.h"

#include <numeric>

#include "server/jobs/mesh_cost.h"
#include "server/mesh/shapes.h"
#include "server/mesh/smooth.h"

namespace isomesh::jobs {
namespace {

void set_smoothed(const mesh::Shapes& shapes, MeshQuality& quality) {
  quality.aspect_ratio.smoothed = shapes.aspect_ratio;
  quality.smallest_angle_deg.smoothed = shapes.smallest_angle_deg;
}

}  // namespace

void smooth_stage(const MeshParameters& parameters, Progress& progress, mesh::Mesh& mesh,
                  MeshSummary& summary) {
  progress.enter(Stage::kSmooth, kSmoothShare, &Timing::smooth);
  const mesh::Shapes extracted = measure_shapes(mesh, progress.quiet());
  summary.quality.aspect_ratio.extracted = extracted.aspect_ratio;
  summary.quality.smallest_angle_deg.extracted = extracted.smallest_angle_deg;
  set_smoothed(extracted, summary.quality);
  const mesh::SmoothingEffect effect = smooth(smooth_options(parameters), progress.context(), mesh);
  summary.area_mm2 = effect.after.area_mm2;
  summary.area_extracted_mm2 = effect.before.area_mm2;
  summary.displacement_mm = {effect.mean_displacement_mm, effect.max_displacement_mm};
  summary.volume_mm3 = {effect.before.volume_mm3, effect.after.volume_mm3};
  summary.bounds = {effect.after.low, effect.after.high};
}

void measure_smoothed_shapes(const MeshParameters& parameters, const Progress& progress,
                             const mesh::Mesh& mesh, MeshQuality& quality) {
  if (parameters.passes > 0) set_smoothed(measure_shapes(mesh, progress.quiet()), quality);
}

mesh::Context SharedProgress::context(std::size_t part) {
  return {stage_.stop, [this, part](double share) {
            done_[part] = share;
            const double sum = std::accumulate(done_.begin(), done_.end(), 0.0);
            stage_.progress(sum / static_cast<double>(done_.size()));
          }};
}

codec::Provenance provenance_of(const SampleArray& samples, const MeshRequest& request) {
  return {.volume = request.volume.id,
          .parameters = request.parameters,
          .iso = request.iso,
          .dims = samples.dims,
          .geometry = samples.geometry,
          .notes = notes_in_mesh(request.volume.notes)};
}

}  // namespace isomesh::jobs
