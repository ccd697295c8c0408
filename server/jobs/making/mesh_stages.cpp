#include "server/jobs/making/mesh_stages.h"

#include <algorithm>
#include <numeric>
#include <string>
#include <vector>

#include "proto/samples.h"
#include "server/jobs/making/error_budget.h"
#include "server/jobs/making/mesh_cost.h"
#include "server/mesh/collapse/bound.h"
#include "server/mesh/collapse/gradient_normals.h"
#include "server/mesh/collapse/simplify.h"
#include "server/mesh/measure/measure.h"
#include "server/mesh/measure/shapes.h"
#include "server/mesh/smooth/smooth.h"

namespace isomesh::jobs {
namespace {

// The distance, as a fraction of the smallest spacing, that vertices keep from a cap's plane. In
// the plane itself their triangles would lie on the cap's.
constexpr double kBesideCaps = 1e-3;

void set_final(const mesh::Shapes& shapes, MeshQuality& quality) {
  quality.aspect_ratio.smoothed = shapes.aspect_ratio;
  quality.smallest_angle_deg.smoothed = shapes.smallest_angle_deg;
}

// The half spaces between the caps of a closed surface. Only steps away from the mean could leave
// them.
std::vector<mesh::HalfSpace> sides_of_caps(const SampleArray& samples,
                                           const MeshParameters& parameters,
                                           const mesh::SmoothOptions& options) {
  if (!parameters.close || !options.goes_outwards()) return {};
  // Labels are capped at the faces of their voxels (separate.h).
  const double wider = parameters.labels ? 0.5 : 0;
  const auto to_space = mesh::lattice_to_space(samples.geometry);
  auto box = mesh::box_around(to_space, {samples.dims[0], samples.dims[1], samples.dims[2]}, wider);
  const double spacing = std::ranges::min(samples.geometry.spacing);
  for (mesh::HalfSpace& half : box) half.offset -= kBesideCaps * spacing;
  return box;
}

Simplification::Bound bound_of(const MeshParameters& parameters,
                               const mesh::SimplificationEffect& effect) {
  if (effect.is_least) return Simplification::Bound::kTopology;
  const bool is_by_triangles = parameters.triangles && effect.reached_triangles;
  return is_by_triangles ? Simplification::Bound::kTriangles : Simplification::Bound::kError;
}

// False if the field proves nothing; then the mesh is unchanged, and the distance is checked
// otherwise.
bool simplify_within_error(const SampleArray& samples, const MeshRequest& request,
                           const Progress& progress, mesh::Mesh& mesh, MeshSummary& summary) {
  const MeshParameters& parameters = request.parameters;
  const double most = *parameters.max_error_mm;
  const mesh::BoundOptions options = {.max_error_mm = most,
                                      .rounding_mm = quantisation_mm(parameters, mesh, most),
                                      .triangles = parameters.triangles.value_or(0),
                                      .is_smoothed = parameters.passes > 0};
  const auto bound = with_sample(samples.type, [&](auto sample) {
    return mesh::simplify_within(lattice_of<decltype(sample)>(samples),
                                 extract_options(parameters, request.iso), options,
                                 progress.context(), mesh);
  });
  if (!bound) return false;
  summary.certificate.emplace().bound_mm = bound->bound_mm + quantisation_mm(parameters, mesh);
  const bool is_by_triangles =
      parameters.triangles && mesh.triangles.size() <= *parameters.triangles;
  summary.simplified = {bound->triangles_before, is_by_triangles ? Simplification::Bound::kTriangles
                                                                 : Simplification::Bound::kError};
  return true;
}

void simplify_checked(const MeshParameters& parameters, const ExtractedSurface& extracted,
                      const Progress& progress, mesh::Mesh& mesh, mesh::SeparatingSurface* walls,
                      MeshSummary& summary) {
  mesh::SimplifyOptions options;
  if (parameters.max_error_mm) {
    options.max_error_mm = *parameters.max_error_mm - quantisation_mm(parameters, mesh);
    options.before = extracted.positions;
  }
  options.triangles = parameters.triangles.value_or(0);
  const mesh::SimplificationEffect effect =
      walls != nullptr ? mesh::simplify(options, progress.context(), *walls)
                       : mesh::simplify(options, progress.context(), mesh);
  summary.simplified = {effect.triangles_before, bound_of(parameters, effect)};
  if (!parameters.max_error_mm) return;
  MeshCertificate& certificate = summary.certificate.emplace();
  if (effect.is_within) {
    certificate.bound_mm = parameters.max_error_mm;
  } else {
    certificate.why_unproven =
        "Some points are farther than the limit, which could not be repaired.";
  }
}

void set_extent(const mesh::Extent& extent, MeshSummary& summary) {
  summary.area_mm2 = extent.area_mm2;
  summary.volume_mm3.smoothed = extent.volume_mm3;
  summary.bounds = {extent.low, extent.high};
}

}  // namespace

bool is_simplified(const MeshParameters& parameters) {
  return parameters.max_error_mm || parameters.triangles;
}

ExtractedSurface::ExtractedSurface(const MeshRequest& request, const mesh::Mesh& mesh) {
  const MeshParameters& parameters = request.parameters;
  if (!request.certify && !parameters.max_error_mm && !parameters.distances) return;
  positions.assign(mesh.positions.begin(), mesh.positions.end());
  triangles.assign(mesh.triangles.begin(), mesh.triangles.end());
}

std::optional<mesh::TriangleGrid> grid_for_distances(const MeshParameters& parameters,
                                                     const ExtractedSurface& extracted,
                                                     const Progress& progress) {
  std::optional<mesh::TriangleGrid> grid;
  if (parameters.distances) grid.emplace(extracted.view(), progress.quiet());
  return grid;
}

void smooth_stage(const SampleArray& samples, const MeshRequest& request, Progress& progress,
                  mesh::Mesh& mesh, MeshSummary& summary) {
  mesh::SmoothOptions options = smooth_options(request.parameters);
  options.within = sides_of_caps(samples, request.parameters, options);
  const auto smooth = [&](const mesh::Context& context) {
    return mesh::smooth(options, context, mesh);
  };
  smooth_stage(smooth, progress, mesh, summary);
}

void smooth_stage(const Smooth& smooth, Progress& progress, const mesh::Mesh& mesh,
                  MeshSummary& summary) {
  progress.enter(Stage::kSmooth);
  const mesh::Shapes extracted = measure_shapes(mesh, progress.quiet());
  summary.quality.aspect_ratio.extracted = extracted.aspect_ratio;
  summary.quality.smallest_angle_deg.extracted = extracted.smallest_angle_deg;
  set_final(extracted, summary.quality);
  const mesh::SmoothingEffect effect = smooth(progress.context());
  summary.area_extracted_mm2 = effect.before.area_mm2;
  summary.displacement_mm = {effect.mean_displacement_mm, effect.max_displacement_mm};
  summary.volume_mm3.extracted = effect.before.volume_mm3;
  set_extent(effect.after, summary);
}

mesh::ExtractOptions extract_options(const MeshParameters& parameters, double iso) {
  return {.iso = iso,
          .scheme = scheme_of(parameters.scheme),
          .interpolation = parameters.interpolation,
          .close = parameters.close,
          .regularize = is_regularized(parameters)};
}

void simplify_stage(const SampleArray& samples, const MeshRequest& request,
                    const ExtractedSurface& extracted, Progress& progress, mesh::Mesh& mesh,
                    mesh::SeparatingSurface* walls, MeshSummary& summary) {
  const MeshParameters& parameters = request.parameters;
  if (!is_simplified(parameters)) return;
  progress.enter(Stage::kSimplify);
  const bool is_done = parameters.max_error_mm && walls == nullptr &&
                       simplify_within_error(samples, request, progress, mesh, summary);
  if (!is_done) simplify_checked(parameters, extracted, progress, mesh, walls, summary);
  if (parameters.normals && walls == nullptr) {
    with_sample(samples.type, [&](auto sample) {
      set_gradient_normals(lattice_of<decltype(sample)>(samples), progress.quiet(), mesh);
    });
  }
  set_extent(measure_extent(mesh, progress.quiet()), summary);
}

void measure_final_shapes(const MeshParameters& parameters, const Progress& progress,
                          const mesh::Mesh& mesh, MeshQuality& quality) {
  if (parameters.passes == 0 && !is_simplified(parameters)) return;
  set_final(measure_shapes(mesh, progress.quiet()), quality);
}

void set_size(const mesh::Mesh& mesh, MeshSummary& summary) {
  summary.triangles = mesh.triangles.size();
  summary.vertices = mesh.positions.size();
  summary.empty = summary.triangles == 0;
}

void conclude_quality(MeshSummary& summary) {
  MeshQuality& quality = summary.quality;
  quality.closed = summary.boundary_edges == 0;
  quality.components = summary.components;
  quality.encloses_volume = quality.closed && quality.oriented;
  if (quality.closed && quality.manifold && quality.oriented) {
    quality.genus = static_cast<std::int64_t>(summary.components) - summary.euler / 2;
  }
}

mesh::Context SharedProgress::context(std::size_t part) {
  return {stage_.stop, [this, part](double share) {
            done_[part] = share;
            const double sum = std::accumulate(done_.begin(), done_.end(), 0.0);
            stage_.progress(sum / static_cast<double>(done_.size()));
          }};
}

codec::Provenance provenance_of(const SampleArray& samples, const MeshRequest& request) {
  return {.samples = request.volume.samples,
          .parameters = request.parameters,
          .iso = request.iso,
          .dims = samples.dims,
          .geometry = samples.geometry,
          .notes = notes_in_mesh(request.volume.notes)};
}

}  // namespace isomesh::jobs
