#include "server/jobs/pipeline.h"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <limits>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "server/codec/encode.h"
#include "server/mesh/components.h"
#include "server/mesh/extract.h"
#include "server/mesh/measure.h"
#include "server/mesh/quality.h"
#include "server/mesh/smooth.h"
#include "server/volume/canonical.h"

namespace isomesh::jobs {
namespace {

using Clock = std::chrono::steady_clock;

// The share of a typical job that each stage takes, for its progress.
constexpr double kLoadShare = 0.02;
constexpr double kExtractShare = 0.05;
constexpr double kSmoothShare = 0.08;
constexpr double kEncodeShare = 1 - kLoadShare - kExtractShare - kSmoothShare;

double milliseconds_since(Clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}

// Follows a job through its stages: times each, reports its progress, passes cancellation on.
class Progress {
 public:
  Progress(std::stop_token stop, const Report& report) : stop_(std::move(stop)), report_(report) {}

  // Ends the stage before and starts this one, which takes `share` of the whole job.
  void enter(Stage stage, double share, double Timing::*elapsed) {
    end_stage();
    stage_ = stage;
    done_before_ += share_;
    share_ = share;
    elapsed_ = elapsed;
    began_ = Clock::now();
    report_(stage_, done_before_, timing_);
  }

  void end_stage() {
    if (elapsed_ != nullptr) timing_.*elapsed_ = milliseconds_since(began_);
  }

  // The context of the part [from, to] of the present stage.
  mesh::Context context(double from = 0, double to = 1) const {
    return {stop_, [this, from, to](double done) {
              report_(stage_, done_before_ + share_ * (from + (to - from) * done), timing_);
            }};
  }

  // One that cancels but does not report.
  mesh::Context quiet() const { return {stop_, nullptr}; }

  const Timing& timing() const { return timing_; }

 private:
  std::stop_token stop_;
  const Report& report_;
  Timing timing_;
  Stage stage_ = Stage::kQueue;
  double done_before_ = 0;
  double share_ = 0;
  double Timing::*elapsed_ = nullptr;
  Clock::time_point began_;
};

mesh::SmoothOptions smooth_options(const JobParameters& parameters) {
  const bool is_taubin = parameters.smoothing == Smoothing::kTaubin;
  const double lambda = parameters.lambda.value_or(default_lambda(parameters.smoothing));
  return {.passes = parameters.passes,
          .lambda = lambda,
          .mu = is_taubin ? mesh::taubin_mu(lambda, parameters.pass_band) : 0,
          .max_displacement_mm =
              parameters.max_displacement_mm.value_or(std::numeric_limits<double>::infinity())};
}

void check_memory(const mesh::SurfaceCount& count, const JobParameters& parameters,
                  const PipelineLimits& limits) {
  const std::uint64_t needed = estimate_memory(size_of(count), parameters);
  if (needed <= limits.memory_bytes) return;
  constexpr std::uint64_t kMebibyte = 1 << 20;
  throw Error(ErrorCode::kTooLarge,
              "the surface has " + std::to_string(count.triangles()) + " triangles and " +
                  std::to_string(count.vertices()) + " vertices; the job would take about " +
                  std::to_string(needed / kMebibyte) + " MiB of memory, and " +
                  std::to_string(limits.memory_bytes / kMebibyte) + " MiB are allowed");
}

// What a job is to be made of and what it may take.
struct Request {
  const JobParameters& parameters;
  const PipelineLimits& limits;
  double iso;
};

template <class T>
void extract_as(const volume::CanonicalVolume& volume, const Request& request,
                const Progress& progress, mesh::Mesh& mesh) {
  const volume::CanonicalHeader& header = volume.header();
  const mesh::Lattice<T> lattice = {reinterpret_cast<const T*>(volume.samples().data()),
                                    {header.dims[0], header.dims[1], header.dims[2]},
                                    mesh::lattice_to_space(header.geometry)};
  const mesh::ExtractOptions options = {.iso = request.iso,
                                        .scheme = request.parameters.scheme,
                                        .interpolation = request.parameters.interpolation,
                                        .close = request.parameters.close};
  const mesh::SurfaceCount count = count_surface(lattice, options, progress.context(0, 0.2));
  check_memory(count, request.parameters, request.limits);
  extract_surface(lattice, options, count, progress.context(0.2, 1), mesh);
}

void extract(const volume::CanonicalVolume& volume, const Request& request,
             const Progress& progress, mesh::Mesh& mesh) {
  switch (volume.header().type) {
    case SampleType::kUint8:
      return extract_as<std::uint8_t>(volume, request, progress, mesh);
    case SampleType::kInt8:
      return extract_as<std::int8_t>(volume, request, progress, mesh);
    case SampleType::kUint16:
      return extract_as<std::uint16_t>(volume, request, progress, mesh);
    case SampleType::kInt16:
      return extract_as<std::int16_t>(volume, request, progress, mesh);
    case SampleType::kUint32:
      return extract_as<std::uint32_t>(volume, request, progress, mesh);
    case SampleType::kInt32:
      return extract_as<std::int32_t>(volume, request, progress, mesh);
    case SampleType::kFloat32:
      return extract_as<float>(volume, request, progress, mesh);
    case SampleType::kFloat64:
      return extract_as<double>(volume, request, progress, mesh);
  }
}

// Fills in what is not known from before smoothing.
void measure_quality(const mesh::Mesh& mesh, const mesh::Topology& topology, bool is_smoothed,
                     const mesh::Context& context, MeshQuality& quality) {
  const mesh::Soundness soundness = check_soundness(mesh, context);
  quality.closed = soundness.boundary_edges == 0;
  quality.manifold = soundness.manifold;
  quality.oriented = soundness.oriented;
  quality.components = topology.components;
  if (quality.closed && quality.manifold && quality.oriented) {
    quality.genus = static_cast<std::int64_t>(topology.components) - topology.euler / 2;
  }
  quality.aspect_ratio.smoothed = quality.aspect_ratio.extracted;
  quality.smallest_angle_deg.smoothed = quality.smallest_angle_deg.extracted;
  if (!is_smoothed) return;
  const mesh::Shapes shapes = measure_shapes(mesh, context);
  quality.aspect_ratio.smoothed = shapes.aspect_ratio;
  quality.smallest_angle_deg.smoothed = shapes.smallest_angle_deg;
}

// Encodes every format and measures the mesh, all side by side: a single Draco stream takes one
// thread.
void encode_and_measure(const codec::Provenance& provenance, const store::BlobStore& blobs,
                        const Progress& progress, const mesh::Mesh& mesh, MeshSummary& summary) {
  const std::vector<MeshFormat>& formats = provenance.parameters.formats;
  std::vector<std::atomic<double>> done(formats.size());
  // Committed together at the end: a job that ends on the way leaves no file of it.
  std::vector<std::unique_ptr<store::BlobWriter>> writers;
  for (std::size_t i = 0; i < formats.size(); ++i) writers.push_back(blobs.begin());
  const mesh::Context stage = progress.context();
  const auto encode = [&](std::size_t i) {
    const mesh::Context context = {stage.stop, [&, i](double share) {
                                     done[i] = share;
                                     const double sum =
                                         std::accumulate(done.begin(), done.end(), 0.0);
                                     stage.progress(sum / static_cast<double>(formats.size()));
                                   }};
    codec::encode(mesh, formats[i], provenance, context,
                  [&](std::span<const std::byte> bytes) { writers[i]->write(bytes); });
  };
  mesh::Topology topology;
  mesh::parallel_for(progress.quiet(), formats.size() + 1, [&](std::size_t task) {
    if (task < formats.size()) return encode(task);
    topology = measure_topology(mesh, progress.quiet());
    measure_quality(mesh, topology, provenance.parameters.passes > 0, progress.quiet(),
                    summary.quality);
  });
  for (std::size_t i = 0; i < formats.size(); ++i) {
    const store::Blob blob = writers[i]->commit();
    summary.files[formats[i]] = {blob.bytes, blob.key, ""};
  }
  summary.boundary_edges = topology.boundary_edges;
  summary.components = topology.components;
  summary.euler = topology.euler;
}

// The volume's file, once its bytes are known to be those that its id names: a mesh of samples that
// a disk has spoilt would look like any other.
store::LocalBlob checked_file(const Volume& volume, const store::BlobStore& blobs,
                              const std::stop_token& stop) {
  const Error spoilt(ErrorCode::kUnusableVolume, "the stored volume is damaged: upload it again");
  try {
    if (!blobs.is_intact(volume.id, stop)) throw spoilt;
    return blobs.local(volume.id);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kNotFound) throw spoilt;
    throw;
  }
}

}  // namespace

void Workspace::trim(std::size_t budget_bytes) {
  const std::size_t held = mesh.positions.capacity_bytes() + mesh.triangles.capacity_bytes();
  if (held > budget_bytes) *this = {};
}

std::uint64_t estimate_memory(const mesh::SurfaceSize& surface, const JobParameters& parameters) {
  // Measured: what Draco takes at its slowest speed, and what GLB's chunks and their bytes add.
  constexpr std::uint64_t kDracoBytesPerTriangle = 100;
  constexpr std::uint64_t kGlbBytesPerTriangle = 15;
  constexpr std::uint64_t kGlbNormalBytesPerTriangle = 8;
  std::uint64_t encoding = surface.vertices * 2 * sizeof(std::uint32_t);  // measured meanwhile
  for (const MeshFormat format : parameters.formats) {
    if (format == MeshFormat::kDrc) encoding += surface.triangles * kDracoBytesPerTriangle;
    if (format == MeshFormat::kGlb) encoding += surface.triangles * kGlbBytesPerTriangle;
    if (format == MeshFormat::kGlb && parameters.normals) {
      encoding +=
          surface.vertices * sizeof(mesh::Vec3) + surface.triangles * kGlbNormalBytesPerTriangle;
    }
  }
  const std::uint64_t smoothing = smoothing_memory(smooth_options(parameters), surface);
  return surface.vertices * sizeof(mesh::Vec3) + surface.triangles * sizeof(mesh::Triangle) +
         smoothing + encoding;
}

PipelineResult run_pipeline(const Volume& volume, const JobParameters& parameters,
                            const PipelineLimits& limits, const store::BlobStore& blobs,
                            Workspace& workspace, std::stop_token stop, const Report& report) {
  Progress progress(stop, report);
  mesh::Mesh& mesh = workspace.mesh;
  PipelineResult result;
  MeshSummary& summary = result.mesh;

  progress.enter(Stage::kLoad, kLoadShare, &Timing::load);
  const store::LocalBlob file = checked_file(volume, blobs, stop);
  const volume::CanonicalVolume samples(file.path);
  samples.preload();

  progress.enter(Stage::kExtract, kExtractShare, &Timing::extract);
  const double iso = parameters.iso.value_or(volume.suggested_iso);
  extract(samples, {parameters, limits, iso}, progress, mesh);
  if (!parameters.components.keeps_all()) {
    const mesh::Dropped dropped = keep_components(parameters.components, progress.quiet(), mesh);
    summary.dropped = {dropped.components, dropped.triangles};
  }
  summary.triangles = mesh.triangles.size();
  summary.vertices = mesh.positions.size();
  const mesh::Shapes extracted = measure_shapes(mesh, progress.quiet());
  summary.quality.aspect_ratio.extracted = extracted.aspect_ratio;
  summary.quality.smallest_angle_deg.extracted = extracted.smallest_angle_deg;

  progress.enter(Stage::kSmooth, kSmoothShare, &Timing::smooth);
  const mesh::SmoothingEffect effect = smooth(smooth_options(parameters), progress.context(), mesh);
  summary.area_mm2 = effect.after.area_mm2;
  summary.area_extracted_mm2 = effect.before.area_mm2;
  summary.displacement_mm = {effect.mean_displacement_mm, effect.max_displacement_mm};
  summary.volume_mm3 = {effect.before.volume_mm3, effect.after.volume_mm3};
  summary.bounds = {effect.after.low, effect.after.high};

  progress.enter(Stage::kEncode, kEncodeShare, &Timing::encode);
  encode_and_measure({parameters, iso, volume.dims, volume.geometry}, blobs, progress, mesh,
                     summary);
  progress.end_stage();
  result.timing = progress.timing();
  return result;
}

}  // namespace isomesh::jobs
