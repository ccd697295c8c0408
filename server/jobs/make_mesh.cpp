#include "server/jobs/make_mesh.h"

#include <algorithm>
#include <functional>
#include <optional>
#include <vector>

#include "proto/samples.h"
#include "server/jobs/mesh_cost.h"
#include "server/jobs/mesh_stages.h"
#include "server/mesh/components.h"
#include "server/mesh/parallel.h"
#include "server/mesh/topology.h"

namespace isomesh::jobs {
namespace {

using Clock = std::chrono::steady_clock;

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
  check_memory(size_of(count), request.parameters, request.memory_bytes);
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
  std::vector<std::optional<mesh::Topology>> shown(formats.size() + 1);
  SharedProgress shared(progress, formats.size());
  const auto encode = [&](std::size_t i) {
    shown[i] = codec::encode(mesh, formats[i], provenance, shared.context(i), sinks[i]);
  };
  const auto measure = [&] {
    measure_smoothed_shapes(parameters, progress, mesh, summary.quality);
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
  std::size_t held = walls.sides.capacity_bytes();
  for (const mesh::Mesh& each : {std::cref(mesh), std::cref(walls.mesh)}) {
    held += each.positions.capacity_bytes() + each.triangles.capacity_bytes();
  }
  if (held > budget_bytes) *this = {};
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
  summary.triangles = mesh.triangles.size();
  summary.vertices = mesh.positions.size();
  check_disk({summary.triangles, summary.vertices}, parameters, request.disk_bytes);

  smooth_stage(parameters, progress, mesh, summary);

  progress.enter(Stage::kEncode, kEncodeShare, &Timing::encode);
  encode_and_measure(provenance_of(samples, request), sinks, progress, mesh, summary);
  return summary;
}

}  // namespace isomesh::jobs
