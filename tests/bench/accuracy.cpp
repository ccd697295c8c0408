#include "tests/bench/accuracy.h"

#include <limits>
#include <random>

#include <meshoptimizer.h>

#include "server/jobs/making/stage_times.h"
#include "server/mesh/measure/distance.h"
#include "tests/bench/label_stages.h"
#include "tests/bench/numbers.h"
#include "tests/bench/peers.h"
#include "tests/bench/stages.h"
#include "tests/bench/timing.h"

namespace isomesh::bench {
namespace {

constexpr int kCertifyRuns = 3;

// Baseline without any code of ours: one call of meshoptimizer on the whole surface.
Decimated meshoptimizer_alone(const mesh::SurfaceView& surface, std::size_t triangles) {
  Decimated result;
  result.positions.assign(surface.positions.begin(), surface.positions.end());
  result.triangles.resize(surface.triangles.size());
  const std::size_t indices = meshopt_simplify(
      result.triangles.front().data(), surface.triangles.front().data(),
      3 * surface.triangles.size(), result.positions.front().data(), result.positions.size(),
      sizeof(mesh::Vec3), 3 * triangles, std::numeric_limits<float>::max());
  result.triangles.resize(indices / 3);
  std::vector<std::uint32_t> remap(result.positions.size());
  const std::size_t vertices = meshopt_optimizeVertexFetchRemap(
      remap.data(), result.triangles.front().data(), indices, remap.size());
  meshopt_remapVertexBuffer(result.positions.data(), result.positions.data(), remap.size(),
                            sizeof(mesh::Vec3), remap.data());
  result.positions.resize(vertices);
  meshopt_remapIndexBuffer(result.triangles.front().data(), result.triangles.front().data(),
                           indices, remap.data());
  return result;
}

MeshParameters parameters_of(const AccuracyPlan& plan) {
  MeshParameters parameters;
  parameters.passes = plan.passes;
  parameters.formats = {MeshFormat::kDrc};
  return parameters;
}

Approximation row_of(std::string name, const JobFigures& job) {
  const Timing& timing = job.timing;
  Approximation row = {.name = std::move(name),
                       .triangles = job.mesh.triangles,
                       .simplify_ms = timing.simplify,
                       .certify_ms = timing.certify,
                       .encode_ms = timing.encode,
                       .bytes = job.bytes};
  row.job_ms = timing.extract + timing.smooth + timing.simplify + timing.encode + timing.certify;
  if (job.mesh.certificate) {
    row.to_scan = job.mesh.certificate->from_mesh;
    row.from_scan = job.mesh.certificate->from_extracted;
  }
  return row;
}

class Measurement {
 public:
  Measurement(const Samples& samples, const AccuracyPlan& plan)
      : plan_(plan),
        extracted_(samples, {.iso = plan.iso}),
        smoothed_(samples, {.iso = plan.iso}),
        job_(samples, {.iso = plan.iso}) {
    extracted_.extract();
    smoothed_.extract();
    smoothed_.smooth(plan.passes);
    peers_.push_back({"meshoptimizer alone", meshoptimizer_alone});
    if (!plan.with_peers) return;
    const std::vector<DecimationPeer> slow = decimation_peers();
    peers_.insert(peers_.end(), slow.begin(), slow.end());
  }

  std::vector<Approximation> run() {
    MeshParameters parameters = parameters_of(plan_);
    job_.run_job(parameters, false);  // maps the memory
    rows_.push_back(row_of("no bound", job_.run_job(parameters, false)));
    rows_.push_back(row_of("no bound, certified", job_.run_job(parameters, true)));
    for (const double error : plan_.errors_mm) {
      parameters.max_error_mm = error;
      rows_.push_back(row_of("E = " + fixed(error, 2) + " mm", job_.run_job(parameters, true)));
      rows_.back().error_mm = error;
      const std::uint64_t triangles = rows_.back().triangles;
      for (const DecimationPeer& peer : peers_) add_peer(peer, triangles);
    }
    return rows_;
  }

 private:
  void add_peer(const DecimationPeer& peer, std::size_t triangles) {
    Decimated decimated;
    Approximation row;
    row.name = peer.name;
    row.is_peer = true;
    row.simplify_ms = time_ms({[&] { decimated = peer.run(smoothed_.mesh(), triangles); }});
    row.triangles = decimated.triangles.size();
    const mesh::Certificate found =
        mesh::certify({decimated.positions, decimated.triangles}, extracted_.mesh(), {});
    row.to_scan = found.from_mesh;
    row.from_scan = found.from_reference;
    rows_.push_back(std::move(row));
  }

  const AccuracyPlan& plan_;
  Stages extracted_;
  Stages smoothed_;
  Stages job_;
  std::vector<DecimationPeer> peers_;
  std::vector<Approximation> rows_;
};

}  // namespace

std::vector<Approximation> measure_approximations(const Samples& samples,
                                                  const AccuracyPlan& plan) {
  set_threads(plan.threads);
  Peers::set_threads(plan.threads);
  return Measurement(samples, plan).run();
}

CertifyTime measure_certify(const Samples& samples, const AccuracyPlan& plan) {
  set_threads(plan.threads);
  Stages extracted(samples, {.iso = plan.iso});
  extracted.extract();
  Stages smoothed(samples, {.iso = plan.iso});
  smoothed.extract();
  smoothed.smooth(plan.passes);
  CertifyTime time;
  time.threads = plan.threads;
  time.ms =
      median_ms({[&] { time.certificate = mesh::certify(smoothed.mesh(), extracted.mesh(), {}); }},
                kCertifyRuns);
  time.points = time.certificate.from_mesh.points + time.certificate.from_reference.points;
  return time;
}

std::vector<UnevenTime> measure_uneven(int threads) {
  constexpr std::uint32_t kSide = 20;
  constexpr std::uint32_t kLabels = 4;
  set_threads(threads);
  std::vector<UnevenTime> times;
  for (const double spacing : {1, 100, 1000}) {
    Samples samples;
    samples.dims = {kSide, kSide, kSide};
    samples.geometry.spacing[2] = spacing;
    std::mt19937 random(1);
    for (std::uint32_t n = 0; n < kSide * kSide * kSide; ++n) {
      samples.bytes.push_back(static_cast<std::byte>(random() % (kLabels + 1)));
    }
    LabelStages stages(samples);
    stages.extract();
    const mesh::SurfaceSize size = {stages.size().triangles, stages.size().vertices};
    const jobs::VolumeSize volume = {kSide * kSide * kSide, 1, spacing};
    UnevenTime time = {.spacing_z = spacing, .triangles = size.triangles};
    const Timing timing = stages.run_job(true).timing;
    time.certify_ms = timing.certify;
    time.job_ms = timing.extract + timing.smooth + timing.encode + timing.certify;
    time.expected_ms = jobs::stage_times(size, size, volume, stages.parameters(), true).certify;
    times.push_back(time);
  }
  return times;
}

Json to_json(const std::vector<UnevenTime>& times) {
  Json rows = Json::array();
  for (const UnevenTime& time : times) {
    rows.push_back({{"spacing_z", time.spacing_z},
                    {"triangles", time.triangles},
                    {"certify_ms", time.certify_ms},
                    {"job_ms", time.job_ms},
                    {"expected_certify_ms", time.expected_ms}});
  }
  return rows;
}

Json to_json(const std::vector<Approximation>& approximations) {
  Json rows = Json::array();
  for (const Approximation& row : approximations) {
    const auto mm = [&](double value) { return row.to_scan.points > 0 ? Json(value) : Json(); };
    rows.push_back({{"name", row.name},
                    {"is_peer", row.is_peer},
                    {"triangles", row.triangles},
                    {"max_to_scan_mm", mm(row.to_scan.max_mm)},
                    {"max_from_scan_mm", mm(row.from_scan.max_mm)},
                    {"rms_from_scan_mm", mm(row.from_scan.rms_mm)},
                    {"simplify_ms", if_measured(row.simplify_ms)},
                    {"certify_ms", if_measured(row.certify_ms)},
                    {"encode_ms", if_measured(row.encode_ms)},
                    {"job_ms", if_measured(row.job_ms)},
                    {"bytes", row.bytes > 0 ? Json(row.bytes) : Json()}});
  }
  return rows;
}

Json to_json(const CertifyTime& time) {
  return {{"threads", time.threads},
          {"points", time.points},
          {"certify_ms", time.ms},
          {"max_to_scan_mm", time.certificate.from_mesh.max_mm},
          {"max_from_scan_mm", time.certificate.from_reference.max_mm}};
}

}  // namespace isomesh::bench
