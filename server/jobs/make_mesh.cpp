#include "server/jobs/make_mesh.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include "proto/samples.h"
#include "server/mesh/components.h"
#include "server/mesh/parallel.h"
#include "server/mesh/shapes.h"
#include "server/mesh/smooth.h"
#include "server/mesh/topology.h"

namespace isomesh::jobs {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kExtractShare = 0.05;
constexpr double kSmoothShare = 0.08;
constexpr double kEncodeShare = 1 - kLoadShare - kExtractShare - kSmoothShare;

mesh::SmoothOptions smooth_options(const MeshParameters& parameters) {
  const bool is_taubin = parameters.smoothing == Smoothing::kTaubin;
  const double lambda = parameters.lambda.value_or(default_lambda(parameters.smoothing));
  return {.passes = parameters.passes,
          .lambda = lambda,
          .mu = is_taubin ? mesh::taubin_mu(lambda, parameters.pass_band) : 0,
          .max_displacement_mm =
              parameters.max_displacement_mm.value_or(std::numeric_limits<double>::infinity())};
}

void check_memory(const mesh::SurfaceCount& count, const MeshParameters& parameters,
                  std::uint64_t allowed) {
  const std::uint64_t needed = estimate_memory(size_of(count), parameters);
  if (needed <= allowed) return;
  constexpr std::uint64_t kMebibyte = 1 << 20;
  throw Error(ErrorCode::kTooLarge,
              "the surface has " + std::to_string(count.triangles()) + " triangles and " +
                  std::to_string(count.vertices()) + " vertices; the job would take about " +
                  std::to_string(needed / kMebibyte) + " MiB of memory, and " +
                  std::to_string(allowed / kMebibyte) + " MiB are allowed");
}

// What the files take at least. STL's size is known; the others' are guesses, of which half counts.
std::uint64_t least_file_bytes(const mesh::SurfaceSize& surface, const MeshParameters& parameters) {
  double bytes = 0;
  for (const MeshFormat format : parameters.formats) {
    const double guess = codec::describe(format).bytes(surface, parameters);
    bytes += format == MeshFormat::kStl ? guess : guess / 2;
  }
  return static_cast<std::uint64_t>(bytes);
}

void check_disk(const mesh::Mesh& mesh, const MeshRequest& request) {
  const std::uint64_t needed =
      least_file_bytes({mesh.triangles.size(), mesh.positions.size()}, request.parameters);
  if (needed <= request.disk_bytes) return;
  constexpr std::uint64_t kKibibyte = 1 << 10;
  throw Error(ErrorCode::kTooLarge,
              "the surface has " + std::to_string(mesh.triangles.size()) +
                  " triangles; its files would take " + std::to_string(needed / kKibibyte) +
                  " KiB or more, and the disk can never hold more than " +
                  std::to_string(request.disk_bytes / kKibibyte) + " KiB of them");
}

template <class T>
mesh::Lattice<T> lattice_of(const SampleArray& samples) {
  return {reinterpret_cast<const T*>(samples.bytes),
          {samples.dims[0], samples.dims[1], samples.dims[2]},
          mesh::lattice_to_space(samples.geometry)};
}

mesh::ExtractOptions extract_options(const MeshParameters& parameters, double iso) {
  return {.iso = iso,
          .scheme = parameters.scheme,
          .interpolation = parameters.interpolation,
          .close = parameters.close};
}

template <class T>
void extract_as(const SampleArray& samples, const MeshRequest& request, const Progress& progress,
                mesh::Mesh& mesh) {
  const mesh::Lattice<T> lattice = lattice_of<T>(samples);
  const mesh::ExtractOptions options = extract_options(request.parameters, request.iso);
  const mesh::SurfaceCount count = count_surface(lattice, options, progress.context(0, 0.2));
  check_memory(count, request.parameters, request.memory_bytes);
  extract_surface(lattice, options, count, progress.context(0.2, 1), mesh);
}

void extract(const SampleArray& samples, const MeshRequest& request, const Progress& progress,
             mesh::Mesh& mesh) {
  with_sample(samples.type,
              [&](auto sample) { extract_as<decltype(sample)>(samples, request, progress, mesh); });
}

void set_topology(const mesh::Topology& topology, MeshSummary& summary) {
  summary.boundary_edges = topology.boundary_edges;
  summary.components = topology.components;
  summary.euler = topology.euler;
  MeshQuality& quality = summary.quality;
  quality.closed = topology.boundary_edges == 0;
  quality.manifold = topology.manifold;
  quality.oriented = topology.oriented;
  quality.components = topology.components;
  if (quality.closed && quality.manifold && quality.oriented) {
    quality.genus = static_cast<std::int64_t>(topology.components) - topology.euler / 2;
  }
}

void set_smoothed_shapes(const mesh::Shapes& shapes, MeshQuality& quality) {
  quality.aspect_ratio.smoothed = shapes.aspect_ratio;
  quality.smallest_angle_deg.smoothed = shapes.smallest_angle_deg;
}

bool shows_topology(const MeshParameters& parameters) {
  return std::ranges::any_of(parameters.formats, [&](MeshFormat format) {
    return codec::describe(format).shows_topology(parameters);
  });
}

// Encodes every format and measures the mesh, all side by side: few of them have work for every
// thread all the time. The topology is measured where no encoder shows it.
void encode_and_measure(const codec::Provenance& provenance, std::span<const codec::Sink> sinks,
                        const Progress& progress, const mesh::Mesh& mesh, MeshSummary& summary) {
  const MeshParameters& parameters = provenance.parameters;
  const std::vector<MeshFormat>& formats = parameters.formats;
  std::vector<std::atomic<double>> done(formats.size());
  std::vector<std::optional<mesh::Topology>> shown(formats.size() + 1);
  const mesh::Context stage = progress.context();
  const auto encode = [&](std::size_t i) {
    const mesh::Context context = {stage.stop, [&, i](double share) {
                                     done[i] = share;
                                     const double sum =
                                         std::accumulate(done.begin(), done.end(), 0.0);
                                     stage.progress(sum / static_cast<double>(formats.size()));
                                   }};
    shown[i] = codec::encode(mesh, formats[i], provenance, context, sinks[i]);
  };
  const auto measure = [&] {
    if (parameters.passes > 0) {
      set_smoothed_shapes(measure_shapes(mesh, progress.quiet()), summary.quality);
    }
    if (!shows_topology(parameters)) shown.back() = measure_topology(mesh, progress.quiet());
  };
  mesh::parallel_for(progress.quiet(), formats.size() + 1, [&](std::size_t task) {
    if (task < formats.size()) return encode(task);
    measure();
  });
  const auto found = std::ranges::find_if(shown, [](const auto& one) { return one.has_value(); });
  set_topology(found != shown.end() ? **found : measure_topology(mesh, progress.quiet()), summary);
}

}  // namespace

void Progress::enter(Stage stage, double share, double Timing::*elapsed) {
  end_stage();
  stage_ = stage;
  done_before_ += share_;
  share_ = share;
  elapsed_ = elapsed;
  began_ = Clock::now();
  report_(stage_, done_before_, timing_);
}

void Progress::end_stage() {
  if (elapsed_ == nullptr) return;
  timing_.*elapsed_ = std::chrono::duration<double, std::milli>(Clock::now() - began_).count();
}

mesh::SurfaceSize count_surface(const SampleArray& samples, const MeshParameters& parameters,
                                double iso, const mesh::Context& context) {
  return with_sample(samples.type, [&](auto sample) {
    return size_of(count_surface(lattice_of<decltype(sample)>(samples),
                                 extract_options(parameters, iso), context));
  });
}

void Workspace::trim(std::size_t budget_bytes) {
  const std::size_t held = mesh.positions.capacity_bytes() + mesh.triangles.capacity_bytes();
  if (held > budget_bytes) *this = {};
}

std::uint64_t estimate_memory(const mesh::SurfaceSize& surface, const MeshParameters& parameters) {
  std::uint64_t encoding = surface.vertices * 2 * sizeof(std::uint32_t);  // measured meanwhile
  for (const MeshFormat format : parameters.formats) {
    encoding += codec::describe(format).memory_bytes(surface, parameters);
  }
  const std::uint64_t smoothing = smoothing_memory(smooth_options(parameters), surface);
  return surface.vertices * sizeof(mesh::Vec3) + surface.triangles * sizeof(mesh::Triangle) +
         smoothing + encoding;
}

MeshSummary make_mesh(const SampleArray& samples, const MeshRequest& request,
                      std::span<const codec::Sink> sinks, Progress& progress, mesh::Mesh& mesh) {
  const MeshParameters& parameters = request.parameters;
  MeshSummary summary;
  progress.enter(Stage::kExtract, kExtractShare, &Timing::extract);
  extract(samples, request, progress, mesh);
  if (!parameters.components.keeps_all()) {
    const mesh::Dropped dropped = keep_components(parameters.components, progress.quiet(), mesh);
    summary.dropped = {dropped.components, dropped.triangles};
  }
  check_disk(mesh, request);
  summary.triangles = mesh.triangles.size();
  summary.vertices = mesh.positions.size();

  progress.enter(Stage::kSmooth, kSmoothShare, &Timing::smooth);
  const mesh::Shapes extracted = measure_shapes(mesh, progress.quiet());
  summary.quality.aspect_ratio.extracted = extracted.aspect_ratio;
  summary.quality.smallest_angle_deg.extracted = extracted.smallest_angle_deg;
  set_smoothed_shapes(extracted, summary.quality);  // also where nothing is smoothed
  const mesh::SmoothingEffect effect = smooth(smooth_options(parameters), progress.context(), mesh);
  summary.area_mm2 = effect.after.area_mm2;
  summary.area_extracted_mm2 = effect.before.area_mm2;
  summary.displacement_mm = {effect.mean_displacement_mm, effect.max_displacement_mm};
  summary.volume_mm3 = {effect.before.volume_mm3, effect.after.volume_mm3};
  summary.bounds = {effect.after.low, effect.after.high};

  progress.enter(Stage::kEncode, kEncodeShare, &Timing::encode);
  encode_and_measure({.volume = request.volume.id,
                      .parameters = parameters,
                      .iso = request.iso,
                      .dims = samples.dims,
                      .geometry = samples.geometry,
                      .notes = notes_in_mesh(request.volume.notes)},
                     sinks, progress, mesh, summary);
  return summary;
}

}  // namespace isomesh::jobs
