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
#include "server/mesh/measure/thickness.h"
#include "server/mesh/smooth/smooth.h"
#include "server/mesh/smooth/untangle.h"

namespace isomesh::jobs {
namespace {

// The distance, as a fraction of the smallest spacing, that vertices keep from a cap's plane. In
// the plane itself their triangles would lie on the cap's.
constexpr double kBesideCaps = 1e-3;

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

void simplify_checked(const MeshParameters& parameters, const KeptSurface& extracted,
                      const Progress& progress, mesh::Mesh& mesh, mesh::SeparatingSurface* walls,
                      MeshSummary& summary) {
  mesh::SimplifyOptions options;
  if (parameters.max_error_mm) {
    const double most = *parameters.max_error_mm;
    options.max_error_mm = most - quantisation_mm(parameters, mesh, most);
    if (error_reference(parameters) == MeshCertificate::Reference::kExtracted) {
      options.before = extracted.positions;
    }
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

bool measures_error_from(MeshCertificate::Reference reference, const MeshRequest& request) {
  const bool is_measured = request.measures.certify || request.parameters.max_error_mm;
  return is_measured && error_reference(request.parameters) == reference;
}

void set_extent(const mesh::Extent& extent, MeshSummary& summary) {
  summary.area_mm2 = extent.area_mm2;
  summary.volume_mm3.smoothed = extent.volume_mm3;
  summary.bounds = {extent.low, extent.high};
}

}  // namespace

KeptSurface kept_extracted(const MeshRequest& request, const mesh::Mesh& mesh) {
  const MeshParameters& parameters = request.parameters;
  const bool is_measured =
      parameters.distances || measures_error_from(MeshCertificate::Reference::kExtracted, request);
  KeptSurface kept;
  if (!is_measured && !parameters.untangle) return kept;
  kept.positions.assign(mesh.positions.begin(), mesh.positions.end());
  if (!is_measured) return kept;
  kept.triangles.assign(mesh.triangles.begin(), mesh.triangles.end());
  return kept;
}

KeptSurface kept_smoothed(const MeshRequest& request, const mesh::Mesh& mesh) {
  if (!measures_error_from(MeshCertificate::Reference::kSmoothed, request)) return {};
  return {{mesh.positions.begin(), mesh.positions.end()},
          {mesh.triangles.begin(), mesh.triangles.end()}};
}

std::optional<mesh::TriangleGrid> grid_for_distances(const MeshParameters& parameters,
                                                     const KeptSurface& extracted,
                                                     const Progress& progress) {
  std::optional<mesh::TriangleGrid> grid;
  if (parameters.distances) grid.emplace(extracted.view(), progress.quiet());
  return grid;
}

void smooth_stage(const SampleArray& samples, const MeshRequest& request, Progress& progress,
                  mesh::Mesh& mesh, MeshSummary& summary) {
  const mesh::SmoothOptions options = smoothing_of(samples, request.parameters);
  const auto smooth = [&](const mesh::Context& context) {
    return mesh::smooth(options, context, mesh);
  };
  smooth_stage(smooth, progress, mesh, summary);
}

void smooth_stage(const Smooth& smooth, Progress& progress, const mesh::Mesh& mesh,
                  MeshSummary& summary) {
  progress.enter(Stage::kSmooth);
  const mesh::Shapes extracted = measure_shapes(mesh, progress.quiet());
  set_smoothing(extracted, smooth(progress.context()), summary);
}

mesh::SmoothOptions smoothing_of(const SampleArray& samples, const MeshParameters& parameters) {
  mesh::SmoothOptions options = smooth_options(parameters);
  options.within = sides_of_caps(samples, parameters, options);
  return options;
}

void set_smoothing(const mesh::Shapes& extracted, const mesh::SmoothingEffect& effect,
                   MeshSummary& summary) {
  summary.quality.aspect_ratio.extracted = extracted.aspect_ratio;
  summary.quality.smallest_angle_deg.extracted = extracted.smallest_angle_deg;
  set_final(extracted, summary.quality);
  summary.area_extracted_mm2 = effect.before.area_mm2;
  summary.displacement_mm = {effect.mean_displacement_mm, effect.max_displacement_mm};
  summary.volume_mm3.extracted = effect.before.volume_mm3;
  set_extent(effect.after, summary);
}

void set_final(const mesh::Shapes& shapes, MeshQuality& quality) {
  quality.aspect_ratio.smoothed = shapes.aspect_ratio;
  quality.smallest_angle_deg.smoothed = shapes.smallest_angle_deg;
}

void set_topology(const mesh::Topology& topology, MeshSummary& summary) {
  summary.boundary_edges = topology.boundary_edges;
  summary.components = topology.components;
  summary.euler = topology.euler;
  summary.quality.manifold = topology.manifold;
  summary.quality.oriented = topology.oriented;
  conclude_quality(summary);
}

void untangle_stage(const MeshParameters& parameters, KeptSurface& extracted, Progress& progress,
                    mesh::Mesh& mesh, MeshSummary& summary) {
  if (!parameters.untangle) return;
  progress.enter(Stage::kUntangle);
  mesh::UntangleOptions options = {.extracted = extracted.positions};
  // Simplification comes first otherwise; and files of labels have each wall twice.
  if (!is_simplified(parameters) && !parameters.labels && has_rounded_files(parameters)) {
    options.is_exact = has_exact_files(parameters);
    options.rounding = [&](const mesh::Mesh& now) { return rounding_of(parameters, now); };
  }
  const mesh::UntangleEffect effect = mesh::untangle(options, progress.context(), mesh);
  summary.untangled = {.pairs = effect.pairs, .vertices = effect.vertices, .left = effect.left};
  if (extracted.triangles.empty()) extracted.positions = {};  // nothing else needs them
  if (effect.vertices == 0) return;
  summary.displacement_mm = {effect.mean_displacement_mm, effect.max_displacement_mm};
  set_extent(measure_extent(mesh, progress.quiet()), summary);
}

mesh::ExtractOptions extract_options(const MeshParameters& parameters, double iso) {
  return {.iso = iso,
          .scheme = scheme_of(parameters.scheme),
          .interpolation = parameters.interpolation,
          .close = parameters.close,
          .regularize = is_regularized(parameters),
          .inside = parameters.inside};
}

void simplify_stage(const SampleArray& samples, const MeshRequest& request,
                    const KeptSurface& extracted, Progress& progress, mesh::Mesh& mesh,
                    mesh::SeparatingSurface* walls, MeshSummary& summary) {
  const MeshParameters& parameters = request.parameters;
  if (!is_simplified(parameters)) return;
  progress.enter(Stage::kSimplify);
  const bool is_done = parameters.max_error_mm && walls == nullptr &&
                       simplify_within_error(samples, request, progress, mesh, summary);
  if (!is_done) simplify_checked(parameters, extracted, progress, mesh, walls, summary);
  if (parameters.normals && walls == nullptr) {
    with_sample(samples.type, [&](auto sample) {
      set_gradient_normals(lattice_of<decltype(sample)>(samples), parameters.inside,
                           progress.quiet(), mesh);
    });
  }
  set_extent(measure_extent(mesh, progress.quiet()), summary);
}

void measure_final_shapes(const MeshParameters& parameters, const Progress& progress,
                          const mesh::Mesh& mesh, MeshQuality& quality) {
  if (parameters.passes == 0 && !is_simplified(parameters)) return;
  set_final(measure_shapes(mesh, progress.quiet()), quality);
}

void thickness_stage(const MeshRequest& request, std::size_t surfaces, const MakeSurface& surface,
                     Progress& progress, MeshSummary& summary) {
  const std::optional<double>& least = request.measures.min_thickness_mm;
  if (!least) return;
  progress.enter(Stage::kThickness);
  Thickness& all = summary.thickness.emplace();
  const double part = 1 / static_cast<double>(surfaces);
  double area = summary.labels.empty() ? summary.area_mm2 : 0;
  for (const LabelSummary& label : summary.labels) area += label.area_mm2;
  for (std::size_t n = 0; n < surfaces; ++n) {
    const auto begin = static_cast<double>(n);
    const mesh::Context context = progress.context().part(part * begin, part * (begin + 1));
    const Thickness one = measure_thickness(surface(n), *least, area, context);
    all.thin_area_mm2 += one.thin_area_mm2;
    if (!one.thinnest_mm || all.thinnest_mm.value_or(*one.thinnest_mm) < *one.thinnest_mm) continue;
    all.thinnest_mm = one.thinnest_mm;
    all.place = one.place;
  }
}

mesh::SurfaceSize size_of(const mesh::Mesh& mesh) {
  return {.triangles = mesh.triangles.size(), .vertices = mesh.positions.size()};
}

void set_size(const mesh::SurfaceSize& surface, MeshSummary& summary) {
  summary.triangles = surface.triangles;
  summary.vertices = surface.vertices;
  summary.empty = summary.triangles == 0;
}

void conclude_quality(MeshSummary& summary) {
  MeshQuality& quality = summary.quality;
  quality.closed = summary.boundary_edges == 0;
  quality.components = summary.components;
  quality.encloses_volume = encloses(quality.closed, quality.oriented, summary.volume_mm3.smoothed);
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
