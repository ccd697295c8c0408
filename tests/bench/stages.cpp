#include "tests/bench/stages.h"

#include <algorithm>
#include <limits>

#include <malloc.h>

#include "server/codec/formats.h"
#include "server/jobs/making/make_mesh.h"
#include "server/jobs/making/mesh_cost.h"
#include "server/jobs/making/stage_times.h"
#include "server/mesh/extract/extract.h"
#include "server/mesh/extract/windows.h"
#include "server/mesh/measure/measure.h"
#include "server/mesh/parallel.h"
#include "server/mesh/smooth/smooth.h"
#include "server/mesh/topology/topology.h"

namespace isomesh::bench {
namespace {

// Counts bytes instead of writing them.
struct CountingSink {
  std::uint64_t bytes = 0;

  codec::Sink sink() {
    return [this](std::span<const std::byte> piece) { bytes += piece.size(); };
  }
};

mesh::ExtractOptions options_of(const Surface& surface) {
  return {.iso = surface.iso,
          .scheme = surface.scheme,
          .interpolation = surface.interpolation,
          .close = surface.close,
          .regularize = surface.regularize};
}

template <class T>
mesh::Lattice<T> lattice_of(const Samples& samples, const T* data) {
  return {data, samples.dims, mesh::lattice_to_space(samples.geometry)};
}

mesh::SmoothOptions smooth_options(int passes, Smoothing smoothing) {
  MeshParameters parameters;
  parameters.passes = passes;
  parameters.smoothing = smoothing;
  return jobs::smooth_options(parameters);
}

}  // namespace

void set_threads(int threads) { mesh::set_thread_count(threads); }

MeshSize Stages::count() const {
  return visit_samples(samples_, [&](const auto* data) {
    const auto count = mesh::count_surface(lattice_of(samples_, data), options_of(surface_), {});
    return MeshSize{count.vertices(), count.triangles()};
  });
}

void Stages::extract() {
  visit_samples(samples_, [&](const auto* data) {
    const auto lattice = lattice_of(samples_, data);
    const mesh::ExtractOptions options = options_of(surface_);
    mesh::SurfaceWindows(lattice, options, {}).write_whole({}, mesh_);
  });
}

mesh::SmoothOptions laplacian_by_labels(const Samples& samples) {
  MeshParameters parameters = label_parameters({});
  parameters.smoothing = Smoothing::kLaplacian;
  parameters.max_displacement_mm = std::ranges::min(samples.geometry.spacing) / 2;
  return jobs::smooth_options(parameters);
}

void Stages::smooth(int passes, Smoothing smoothing) {
  mesh::smooth(smooth_options(passes, smoothing), {}, mesh_);
}

std::uint64_t Stages::smoothing_memory(int passes) const {
  return visit_samples(samples_, [&](const auto* data) {
    const auto count = mesh::count_surface(lattice_of(samples_, data), options_of(surface_), {});
    return mesh::smoothing_memory(smooth_options(passes, Smoothing::kLaplacian), size_of(count));
  });
}

void Stages::measure_topology() const { mesh::measure_topology(mesh_, {}); }

std::uint64_t Stages::encode(MeshFormat format, const MeshParameters& parameters) const {
  codec::Provenance provenance;
  provenance.iso = surface_.iso;
  provenance.dims = {samples_.dims.x, samples_.dims.y, samples_.dims.z};
  provenance.geometry = samples_.geometry;
  provenance.parameters = parameters;
  CountingSink counting;
  codec::encode(mesh_, format, provenance, {}, counting.sink());
  return counting.bytes;
}

std::string Stages::drc() const {
  std::string bytes;
  codec::encode_drc(mesh_, {}, {}, [&](std::span<const std::byte> piece) {
    bytes.append(reinterpret_cast<const char*>(piece.data()), piece.size());
  });
  return bytes;
}

JobFigures run_job(const Samples& samples, const MeshParameters& parameters, double iso,
                   const Measures& measures, const MakeJob& make) {
  CountingSink counting;
  const std::vector<codec::Sink> sinks(parameters.formats.size(), counting.sink());
  const jobs::Report nobody = [](Stage, double, const Timing&) {};
  jobs::Progress progress({}, nobody, jobs::stage_times({}, {}, {}, parameters, measures));
  const auto& [x, y, z] = samples.dims;
  const Volume volume;
  JobFigures figures;
  figures.mesh = make({samples.type, {x, y, z}, samples.geometry, samples.bytes.data()},
                      {.volume = volume,
                       .parameters = parameters,
                       .iso = iso,
                       .measures = measures,
                       .memory_bytes = std::numeric_limits<std::uint64_t>::max()},
                      sinks, progress);
  progress.end_stage();
  figures.timing = progress.timing();
  figures.bytes = counting.bytes;
  return figures;
}

JobFigures Stages::run_job(const MeshParameters& asked, bool certify) {
  MeshParameters parameters = asked;
  parameters.scheme = SchemeName{static_cast<int>(surface_.scheme)};
  parameters.interpolation = surface_.interpolation;
  parameters.close = surface_.close;
  parameters.regularize = surface_.regularize;
  return bench::run_job(samples_, parameters, surface_.iso, {.certify = certify},
                        [&](const jobs::SampleArray& array, const jobs::MeshRequest& request,
                            std::span<const codec::Sink> sinks, jobs::Progress& progress) {
                          return jobs::make_mesh(array, request, sinks, progress, mesh_);
                        });
}

void Stages::release_memory() {
  mesh_ = {};
  malloc_trim(0);  // or smaller blocks stay mapped
}

MeshSize Stages::size() const { return {mesh_.positions.size(), mesh_.triangles.size()}; }

double Stages::volume_mm3() const { return mesh::measure_extent(mesh_, {}).volume_mm3; }

std::uint64_t Stages::mesh_bytes() const {
  return positions().size_bytes() + triangles().size_bytes();
}

MeshParameters job_to(MeshFormat format, int passes) {
  MeshParameters parameters;
  parameters.passes = passes;
  parameters.formats = {format};
  return parameters;
}

}  // namespace isomesh::bench
