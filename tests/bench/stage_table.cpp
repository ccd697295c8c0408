#include "tests/bench/stage_table.h"

#include <functional>
#include <regex>
#include <utility>

#include "tests/bench/memory.h"
#include "tests/bench/peers.h"
#include "tests/bench/stages.h"
#include "tests/bench/timing.h"

namespace isomesh::bench {
namespace {

constexpr int kPasses = 5;
constexpr int kRuns = 5;
constexpr std::uint32_t kLargestSlowPeer = 256;  // samples along an axis

struct Encoding {
  const char* name;
  MeshFormat format;
  MeshParameters parameters = {};
};

// Draco has two methods, which the encoder chooses between by its speed: edgebreaker at the default
// speed, sequential at the highest.
std::vector<Encoding> encodings() {
  constexpr int kSequentialSpeed = 10;
  std::vector<Encoding> all = {
      {"drc", MeshFormat::kDrc},         {"drc, sequential", MeshFormat::kDrc},
      {"glb", MeshFormat::kGlb},         {"glb without normals", MeshFormat::kGlb},
      {"glb, merged", MeshFormat::kGlb}, {"glb, meshopt", MeshFormat::kGlb},
      {"glb, none", MeshFormat::kGlb},   {"glb, quantized", MeshFormat::kGlb},
      {"stl", MeshFormat::kStl}};
  all[1].parameters.draco.speed = kSequentialSpeed;
  all[3].parameters.normals = false;
  all[4].parameters.merge = true;
  all[5].parameters.glb_codec = GlbCodec::kMeshopt;
  all[6].parameters.glb_codec = GlbCodec::kNone;
  all[7].parameters.glb_codec = GlbCodec::kQuantized;
  return all;
}

// The rows of one volume.
class StageTable {
 public:
  StageTable(const Samples& samples, double iso, const Plan& plan, Json& rows)
      : samples_(samples), iso_(iso), plan_(plan), filter_(plan.filter), rows_(rows) {}

  void add_ours(const Surface& surface) {
    Stages stages(samples_, surface);
    const auto extract = [&] { stages.extract(); };
    for (const int threads : plan_.threads) {
      set_threads(threads);
      extract();
      const auto add = [&](const std::string& stage, const Timed& timed) {
        add_row(stage, describe(surface), threads, stages.size(), timed);
      };
      add("count", {[&] { stages.count(); }});
      add("extract, reused memory", {extract});
      add("extract, fresh memory", {extract, [&] { stages.release_memory(); }});
      if (surface.interpolation == Interpolation::kMidpoint) continue;
      add("smooth", {[&] { stages.smooth(kPasses); }, extract});
      extract();
      stages.smooth(kPasses);
      add("topology", {[&] { stages.measure_topology(); }});
      for (const auto& [name, format, parameters] : encodings()) {
        add(std::string("encode ") + name, {[&] { stages.encode(format, parameters); }});
      }
      for (const MeshFormat format : {MeshFormat::kDrc, MeshFormat::kGlb}) {
        add("job to " + std::string(to_string(format)),
            {[&] { stages.run_job(job_to(format, kPasses)); }});
      }
    }
  }

  void add_peers() {
    if (!peers_available()) return;
    Peers peers(samples_, iso_);
    const auto release = [&] { peers.release(); };
    const bool is_small = samples_.dims.x <= kLargestSlowPeer;
    for (const int threads : plan_.threads) {
      Peers::set_threads(threads);
      peers.flying_edges();
      const MeshSize size = peers.size();
      const auto add = [&](const std::string& filter, const Timed& timed) {
        add_row(filter, "VTK", threads, size, timed);
      };
      add("vtkFlyingEdges3D", {[&] { peers.flying_edges(); }, release});
      peers.flying_edges();
      if (is_small) add("vtkSmoothPolyDataFilter", {[&] { peers.smooth(kPasses); }});
      add("vtkWindowedSincPolyDataFilter", {[&] { peers.windowed_sinc(kPeerSincPasses); }});
      add("libdraco", {[&] { peers.draco(); }});
      add("all three", {[&] { peers.pipeline(); }, release});
    }
  }

 private:
  static std::string describe(const Surface& surface) {
    std::string text(name_of(surface.scheme));
    if (surface.regularize) text += ", regularised";
    return surface.interpolation == Interpolation::kMidpoint ? text + ", midpoint" : text;
  }

  void add_row(const std::string& stage, const std::string& scheme, int threads,
               const MeshSize& size, const Timed& timed) {
    if (!std::regex_search(stage + ", " + samples_.name, filter_)) return;
    const double ms = median_ms(timed, kRuns);
    rows_.push_back({{"stage", stage},
                     {"volume", samples_.name},
                     {"scheme", scheme},
                     {"threads", threads},
                     {"triangles", size.triangles},
                     {"ms", ms},
                     {"Mtriangles/s", static_cast<double>(size.triangles) / ms / 1000}});
  }

  const Samples& samples_;
  const double iso_;
  const Plan& plan_;
  const std::regex filter_;
  Json& rows_;
};

void add_volume(const Samples& samples, double iso, const Plan& plan, Json& rows) {
  StageTable table(samples, iso, plan, rows);
  for (const Scheme scheme : {Scheme::kSix, Scheme::kFive, Scheme::kBcc}) {
    table.add_ours({.iso = iso, .scheme = scheme});
    table.add_ours({.iso = iso, .scheme = scheme, .regularize = true});
    table.add_ours({.iso = iso, .scheme = scheme, .interpolation = Interpolation::kMidpoint});
  }
  table.add_peers();
}

Json growth_row(std::uint32_t size, int threads) {
  const Samples field = synthetic_field(size);
  Stages stages(field, {.iso = kFieldIso});
  const auto extract = [&] { stages.extract(); };
  extract();
  stages.smooth(kPasses);
  Json row = {
      {"size", std::to_string(size) + "^3"},
      {"triangles", stages.size().triangles},
      {"extract_ms", median_ms({extract}, kRuns)},
      {"smooth_ms", median_ms({[&] { stages.smooth(kPasses); }, extract}, kRuns)},
      {"job_ms", median_ms({[&] { stages.run_job(job_to(MeshFormat::kDrc, kPasses)); }}, kRuns)}};
  std::vector<std::pair<std::string, std::string>> processes = {
      {"extract", kExtractStage}, {"smooth", kSmoothStage}, {"job", kJobStage}};
  if (peers_available()) {
    Peers peers(field, kFieldIso);
    const auto release = [&] { peers.release(); };
    row["flying_edges_ms"] = median_ms({[&] { peers.flying_edges(); }, release}, kRuns);
    row["vtk_draco_ms"] = median_ms({[&] { peers.pipeline(); }, release}, kRuns);
    processes.insert(processes.end(),
                     {{"flying_edges", kPeerExtractStage}, {"vtk_draco", kPeerJobStage}});
  }
  row["least_bytes"] = field.bytes.size() + stages.mesh_bytes();
  for (const auto& [name, stage] : processes) {
    const auto memory = measure_memory(stage, std::to_string(size), threads);
    row[name + "_bytes"] = memory ? Json(memory->peak_bytes) : Json();
  }
  return row;
}

}  // namespace

Json measure_stages(const Plan& plan) {
  Json rows = Json::array();
  if (plan.volume) add_volume(*plan.volume, plan.iso, plan, rows);
  for (const std::uint32_t size : plan.field_sizes) {
    add_volume(synthetic_field(size), kFieldIso, plan, rows);
  }
  return rows;
}

Json measure_growth(const Plan& plan) {
  const int threads = plan.threads.back();
  set_threads(threads);
  Peers::set_threads(threads);
  Json rows = Json::array();
  for (const std::uint32_t size : plan.field_sizes) rows.push_back(growth_row(size, threads));
  return rows;
}

}  // namespace isomesh::bench
