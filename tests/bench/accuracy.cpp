#include "tests/bench/accuracy.h"

#include <algorithm>
#include <iomanip>
#include <limits>
#include <sstream>

#include <meshoptimizer.h>

#include "server/codec/encode.h"
#include "server/mesh/simplify.h"
#include "tests/bench/decimation_peers.h"
#include "tests/bench/numbers.h"
#include "tests/bench/peers.h"
#include "tests/bench/stages.h"
#include "tests/bench/timing.h"

namespace isomesh::bench {
namespace {

constexpr int kCertifyRuns = 3;

mesh::Mesh copy_of(const mesh::Mesh& mesh) {
  mesh::Mesh copy;
  copy.origin = mesh.origin;
  copy.positions.resize_for_overwrite(mesh.positions.size());
  std::ranges::copy(mesh.positions, copy.positions.begin());
  copy.triangles.resize_for_overwrite(mesh.triangles.size());
  std::ranges::copy(mesh.triangles, copy.triangles.begin());
  copy.layer_vertices = mesh.layer_vertices;
  copy.layer_triangles = mesh.layer_triangles;
  copy.on_border = mesh.on_border;
  return copy;
}

// What a caller of the library has without anything of ours: one call on the whole surface.
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

class Measurement {
 public:
  Measurement(const mesh::Mesh& original, const AccuracyPlan& plan)
      : original_(original), plan_(plan) {
    peers_.push_back({"meshoptimizer alone", meshoptimizer_alone});
    if (!plan.with_peers) return;
    const std::vector<DecimationPeer> slow = decimation_peers();
    peers_.insert(peers_.end(), slow.begin(), slow.end());
  }

  std::vector<Approximation> run() {
    mesh::Mesh whole = copy_of(original_);
    Approximation& as_it_is = rows_.emplace_back();
    as_it_is.name = "as it is";
    encode(whole, as_it_is);
    for (const double error : plan_.errors_mm) {
      add_ours(error);
      const std::uint64_t triangles = rows_.back().triangles;
      for (const DecimationPeer& peer : peers_) add_peer(peer, triangles);
    }
    return rows_;
  }

 private:
  void encode(const mesh::Mesh& mesh, Approximation& row) {
    row.triangles = mesh.triangles.size();
    row.encode_ms = time_ms({[&] {
      row.bytes = 0;
      codec::encode_drc(mesh, {}, {}, [&](auto piece) { row.bytes += piece.size(); });
    }});
  }

  void certify(const mesh::SurfaceView& mesh, Approximation& row) {
    row.certify_ms = time_ms({[&] { row.certificate = mesh::certify(mesh, original_, {}); }});
  }

  void add_ours(double error_mm) {
    mesh::Mesh mesh = copy_of(original_);
    Approximation row;
    row.name = "E = " + fixed(error_mm, 2) + " mm";
    row.simplify_ms = time_ms({[&] { mesh::simplify({.max_error_mm = error_mm}, {}, mesh); }});
    certify(mesh, row);
    encode(mesh, row);
    rows_.push_back(std::move(row));
  }

  void add_peer(const DecimationPeer& peer, std::size_t triangles) {
    Decimated decimated;
    Approximation row;
    row.name = "  " + peer.name;
    row.simplify_ms = time_ms({[&] { decimated = peer.run(original_, triangles); }});
    row.triangles = decimated.triangles.size();
    certify({decimated.positions, decimated.triangles}, row);
    rows_.push_back(std::move(row));
  }

  const mesh::Mesh& original_;
  const AccuracyPlan& plan_;
  std::vector<DecimationPeer> peers_;
  std::vector<Approximation> rows_;
};

}  // namespace

std::vector<Approximation> measure_approximations(const Samples& samples,
                                                  const AccuracyPlan& plan) {
  set_threads(plan.threads);
  Peers::set_threads(plan.threads);
  Stages stages(samples, {.iso = plan.iso});
  stages.extract();
  stages.smooth(plan.passes);
  return Measurement(stages.mesh(), plan).run();
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

std::string to_table(const std::vector<Approximation>& approximations) {
  std::ostringstream text;
  const auto cells = [&](const std::string& name, const std::vector<std::string>& values) {
    text << std::left << std::setw(24) << name << std::right;
    for (const std::string& value : values) text << std::setw(13) << value;
    text << '\n';
  };
  const auto ms = [](double value) { return value > 0 ? milliseconds(value) : std::string("-"); };
  cells("", {"triangles", "max to scan", "max to mesh", "rms to mesh", "simplify", "certify",
             "encode", "bytes"});
  for (const Approximation& row : approximations) {
    const bool has_certificate = row.certificate.from_mesh.points > 0;
    const auto mm = [&](double value) { return has_certificate ? fixed(value, 4) : "-"; };
    cells(row.name,
          {grouped(row.triangles), mm(row.certificate.from_mesh.max_mm),
           mm(row.certificate.from_reference.max_mm), mm(row.certificate.from_reference.rms_mm),
           ms(row.simplify_ms), ms(row.certify_ms), ms(row.encode_ms),
           row.bytes > 0 ? grouped(row.bytes) : "-"});
  }
  return text.str();
}

std::string to_text(const CertifyTime& time) {
  const mesh::Certificate& found = time.certificate;
  return std::to_string(time.threads) + (time.threads == 1 ? " thread: " : " threads: ") +
         milliseconds(time.ms) + " for " + grouped(time.points) + " points, " +
         fixed(1e6 * time.ms / static_cast<double>(std::max<std::uint64_t>(1, time.points)), 0) +
         " ns a point; smoothed to extracted at most " + fixed(found.from_mesh.max_mm, 3) +
         " mm, extracted to smoothed " + fixed(found.from_reference.max_mm, 3) + " mm\n";
}

}  // namespace isomesh::bench
