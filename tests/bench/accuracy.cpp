#include "tests/bench/accuracy.h"

#include <limits>
#include <random>

#include <meshoptimizer.h>

#include "proto/mesh_summary.h"
#include "server/jobs/making/stage_times.h"
#include "server/mesh/measure/distance.h"
#include "tests/bench/label_stages.h"
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

// Distances of nothing where they were not measured.
Json row_of(const std::string& name, std::uint64_t triangles, const DistanceSummary& to_scan,
            const DistanceSummary& from_scan) {
  const auto mm = [&](double value) { return to_scan.points > 0 ? Json(value) : Json(); };
  return {{"name", name},
          {"triangles", triangles},
          {"max_to_scan_mm", mm(to_scan.max_mm)},
          {"max_from_scan_mm", mm(from_scan.max_mm)},
          {"rms_from_scan_mm", mm(from_scan.rms_mm)}};
}

void add_times(double simplify_ms, const Timing& timing, Json& row) {
  row["simplify_ms"] = if_measured(simplify_ms);
  row["certify_ms"] = if_measured(timing.certify);
  row["encode_ms"] = if_measured(timing.encode);
  row["job_ms"] = if_measured(timing.extract + timing.smooth + timing.simplify + timing.encode +
                              timing.certify);
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

  Json run() {
    MeshParameters parameters = job_to(MeshFormat::kDrc, plan_.passes);
    job_.run_job(parameters);  // maps the memory
    add_job("no bound", parameters, false);
    add_job("no bound, certified", parameters, true);
    for (const double error : plan_.errors_mm) {
      parameters.max_error_mm = error;
      const std::uint64_t triangles = add_job("E = " + fixed(error, 2) + " mm", parameters, true);
      for (const DecimationPeer& peer : peers_) add_peer(peer, triangles);
    }
    return rows_;
  }

 private:
  // Returns the number of triangles.
  std::uint64_t add_job(const std::string& name, const MeshParameters& parameters, bool certify) {
    const JobFigures job = job_.run_job(parameters, certify);
    const auto certificate =
        job.mesh.certificate.value_or(decltype(job.mesh.certificate)::value_type{});
    rows_.push_back(
        row_of(name, job.mesh.triangles, certificate.from_mesh, certificate.from_extracted));
    add_times(job.timing.simplify, job.timing, rows_.back());
    rows_.back()["bytes"] = job.bytes;
    return job.mesh.triangles;
  }

  void add_peer(const DecimationPeer& peer, std::size_t triangles) {
    Decimated decimated;
    const double ms = time_ms({[&] { decimated = peer.run(smoothed_.mesh(), triangles); }});
    const mesh::Certificate found =
        mesh::certify({decimated.positions, decimated.triangles}, extracted_.mesh(), {});
    rows_.push_back(
        row_of(peer.name, decimated.triangles.size(), found.from_mesh, found.from_reference));
    add_times(ms, {}, rows_.back());
    rows_.back()["job_ms"] = Json();
    rows_.back()["bytes"] = Json();
  }

  const AccuracyPlan& plan_;
  Stages extracted_;
  Stages smoothed_;
  Stages job_;
  std::vector<DecimationPeer> peers_;
  Json rows_ = Json::array();
};

}  // namespace

Json measure_approximations(const Samples& samples, const AccuracyPlan& plan) {
  set_threads(plan.threads);
  Peers::set_threads(plan.threads);
  return Measurement(samples, plan).run();
}

Json measure_certify(const Samples& samples, const AccuracyPlan& plan) {
  set_threads(plan.threads);
  Stages extracted(samples, {.iso = plan.iso});
  extracted.extract();
  Stages smoothed(samples, {.iso = plan.iso});
  smoothed.extract();
  smoothed.smooth(plan.passes);
  mesh::Certificate found;
  const double ms = median_ms(
      {[&] { found = mesh::certify(smoothed.mesh(), extracted.mesh(), {}); }}, kCertifyRuns);
  return Json::array({{{"threads", plan.threads},
                       {"points", found.from_mesh.points + found.from_reference.points},
                       {"certify_ms", ms},
                       {"max_to_scan_mm", found.from_mesh.max_mm},
                       {"max_from_scan_mm", found.from_reference.max_mm}}});
}

Json measure_uneven(int threads) {
  constexpr std::uint32_t kSide = 20;
  constexpr std::uint32_t kLabels = 4;
  set_threads(threads);
  Json rows = Json::array();
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
    const Timing timing = stages.run_job(true).timing;
    rows.push_back(
        {{"spacing_z", spacing},
         {"triangles", size.triangles},
         {"certify_ms", timing.certify},
         {"job_ms", timing.extract + timing.smooth + timing.encode + timing.certify},
         {"expected_ms",
          jobs::stage_times(size, size, volume, stages.parameters(), {.certify = true}).certify}});
  }
  return rows;
}

}  // namespace isomesh::bench
