#include "tests/bench/labels.h"

#include <cmath>

#include "tests/bench/label_body.h"
#include "tests/bench/label_stages.h"
#include "tests/bench/memory.h"
#include "tests/bench/numbers.h"
#include "tests/bench/peers.h"
#include "tests/bench/stages.h"
#include "tests/bench/timing.h"

namespace isomesh::bench {
namespace {

namespace fs = std::filesystem;

constexpr Goal kPerLabelGoal = {0.1};
// Beside SurfaceNets with its 16 passes.
constexpr Goal kStairsGoal = {1.0};
constexpr Goal kLaplacianGoal = {0.5};
constexpr Goal kJobGoal = {1.5};
constexpr Goal kMemoryGoal = {1.2};
constexpr int kLabelPairs = 3;
constexpr std::size_t kProbes = 400'000;

mesh::SmoothOptions taubin() { return smooth_options(20, Smoothing::kTaubin); }

// Collects what is found about one segmentation.
class LabelComparison {
 public:
  LabelComparison(const Samples& samples, const LabelPlan& plan)
      : samples_(samples), plan_(plan), stages_(samples) {
    stages_.extract();
    which_ = std::to_string(stages_.labels().size()) + " labels, " + samples.name;
  }

  std::vector<Finding> run() {
    compare_surface_nets();
    compare_flying_edges();
    add_stages();
    add_alone("count_voxels", "voxels and bounds of each", {[&] { stages_.count_voxels(); }});
    add_alone("measure", "topology, area and volume of each", {[&] { stages_.measure(); }});
    const std::uint64_t triangles = stages_.size().triangles;
    findings_.push_back({"labels/triangles",
                         "triangles, " + which_,
                         grouped(triangles),
                         "",
                         static_cast<double>(triangles),
                         {}});
    return std::move(findings_);
  }

 private:
  void extract() { stages_.extract(); }
  void extract_and_smooth() {
    stages_.extract();
    stages_.smooth(laplacian_by_labels(samples_));
  }
  void extract_and_remove_stairs() {
    stages_.extract();
    stages_.remove_stairs();
  }

  void add_alone(const std::string& name, const std::string& what, const Timed& ours) {
    const double ms = median_ms(ours, kLabelPairs);
    findings_.push_back({"labels/" + name, what + ", ms, " + which_, milliseconds(ms), "", ms, {}});
  }

  // Adds the time of stair removal alone and of each stage of a job.
  void add_stages() {
    stages_.extract();
    add_alone("remove_stairs", "the stairs of all alone",
              {[&] { stages_.remove_stairs(); }, [&] { stages_.extract(); }});
    stages_.run_job();
    const Timing timing = stages_.run_job().timing;
    const auto add_stage = [&](const std::string& name, double ms) {
      findings_.push_back({"labels/job/" + name,
                           name + " of a job to a GLB, ms, " + which_,
                           milliseconds(ms),
                           "",
                           ms,
                           {}});
    };
    add_stage("extract", timing.extract);
    add_stage("smooth", timing.smooth);
    add_stage("encode", timing.encode);
  }

  void add(const std::string& name, const std::string& what, const Paired& times,
           std::optional<Goal> goal) {
    findings_.push_back({"labels/" + name, what + ", " + which_, milliseconds(times.ours_ms),
                         milliseconds(times.peer_ms), times.ratio, goal});
  }

  void compare_surface_nets() {
    if (plan_.surface_nets_root.empty()) return;
    SurfaceNets nets(plan_.surface_nets_root, samples_, stages_.labels(), plan_.threads);
    const auto compare = [&](const std::string& name, const std::string& what, const Timed& ours,
                             Goal goal) {
      time_ms(ours);
      add(name, what + " / SurfaceNets with 16 passes",
          pair_times([&] { return time_ms(ours); }, [&] { return nets.run_ms(); }, kLabelPairs),
          goal);
    };
    compare("surface_nets/labels", "surface without stairs", {[&] { extract_and_remove_stairs(); }},
            kStairsGoal);
    compare("surface_nets/laplacian", "surface with 10 Laplacian passes",
            {[&] { extract_and_smooth(); }}, kLaplacianGoal);
    compare("surface_nets/job", "job to a GLB", {[&] { stages_.run_job(); }}, kJobGoal);
    compare_memory(nets);
  }

  void compare_memory(const SurfaceNets& nets) {
    const auto ours = measure_memory(kLabelJobStage, samples_.source, plan_.threads);
    if (!ours) return;
    const double ratio =
        static_cast<double>(ours->peak_bytes) / static_cast<double>(nets.peak_bytes());
    findings_.push_back(
        {"labels/surface_nets/memory", "peak memory of a job to a GLB / SurfaceNets, " + which_,
         mebibytes(ours->peak_bytes), mebibytes(nets.peak_bytes()), ratio, kMemoryGoal});
  }

  void compare_flying_edges() {
    const Timed bare = {[&] { extract(); }};
    const Timed smoothed = {[&] { extract_and_smooth(); }};
    if (!peers_available()) {
      add_alone("extract", "extraction of all", bare);
      add_alone("extract_smooth", "the same and 10 passes of smoothing", smoothed);
      return;
    }
    Peers peers(samples_, 0);
    const auto release = [&] { peers.release(); };
    const Timed theirs = {[&] { peers.discrete_flying_edges(stages_.labels()); }, release};
    const Timed theirs_smoothed = {[&] {
                                     peers.discrete_flying_edges(stages_.labels());
                                     peers.smooth_labels();
                                   },
                                   release};
    add("extract", "extraction of all / discrete Flying Edges a label",
        time_in_pairs(bare, theirs, kLabelPairs), kPerLabelGoal);
    add("extract_smooth", "with 10 passes of smoothing / with windowed sinc a label",
        time_in_pairs(smoothed, theirs_smoothed, kLabelPairs), {});
  }

  const Samples& samples_;
  const LabelPlan& plan_;
  LabelStages stages_;
  std::string which_;
  std::vector<Finding> findings_;
};

LabelQuality::Volumes compare_volumes(const Walls& walls,
                                      const std::vector<mesh::LabelVoxels>& voxels) {
  const std::vector<double> enclosed = enclosed_volumes(walls, voxels.size());
  LabelQuality::Volumes volumes;
  double all_enclosed = 0;
  double all_voxels = 0;
  for (std::size_t l = 0; l < voxels.size(); ++l) {
    all_enclosed += enclosed[l];
    all_voxels += voxels[l].volume_mm3;
    const double change = enclosed[l] / voxels[l].volume_mm3 - 1;
    if (l > 0 && std::abs(change) <= std::abs(volumes.worst)) continue;
    volumes.worst = change;
    volumes.worst_label = voxels[l].label;
    volumes.worst_voxels = voxels[l].voxels;
  }
  volumes.all = all_enclosed / all_voxels - 1;
  return volumes;
}

// Looks at what is made in several ways, at the same points.
class QualityOfWays {
 public:
  explicit QualityOfWays(const Samples& samples)
      : stages_(samples), probes_(probes_near_walls(samples, stages_.labels(), kProbes)) {}

  LabelStages& stages() { return stages_; }

  LabelQuality look(const std::string& way, const Walls& walls, bool has_winding) const {
    LabelQuality quality = {
        way, {walls.positions.size(), walls.triangles.size()}, measure_sharing(walls, probes_), {}};
    if (has_winding) quality.volumes = compare_volumes(walls, stages_.voxels());
    return quality;
  }

 private:
  LabelStages stages_;
  std::vector<Probe> probes_;
};

}  // namespace

std::vector<Samples> segmentations(std::uint32_t body_samples) {
  std::vector<Samples> all;
  all.push_back(label_body(body_samples));
  for (const char* name : {"aal", "brodmann", "JHU-WhiteMatter-labels-1mm"}) {
    const fs::path path =
        fs::path("/usr/share/mricron/templates") / (std::string(name) + ".nii.gz");
    if (!fs::exists(path)) continue;
    all.push_back(load_labels(path));
    all.back().name = name;
  }
  return all;
}

std::vector<Finding> measure_label_findings(const Samples& samples, const LabelPlan& plan) {
  set_threads(plan.threads);
  Peers::set_threads(plan.threads);
  return LabelComparison(samples, plan).run();
}

std::vector<LabelQuality> measure_label_quality(const Samples& samples, const LabelPlan& plan) {
  set_threads(plan.threads);
  Peers::set_threads(plan.threads);
  QualityOfWays ways(samples);
  LabelStages& stages = ways.stages();
  std::vector<LabelQuality> qualities;
  stages.extract();
  stages.remove_stairs();
  qualities.push_back(ways.look("isomesh without stairs", stages.walls(), true));
  stages.extract();
  stages.smooth(laplacian_by_labels(samples));
  qualities.push_back(ways.look("isomesh, 10 Laplacian passes", stages.walls(), true));
  stages.extract();
  stages.smooth(taubin());
  qualities.push_back(ways.look("isomesh, 20 Taubin passes", stages.walls(), true));
  if (!plan.surface_nets_root.empty()) {
    SurfaceNets nets(plan.surface_nets_root, samples, stages.labels(), plan.threads);
    nets.run_ms();
    qualities.push_back(ways.look("SurfaceNets, 16 passes", nets.walls(), false));
  }
  if (peers_available()) {
    Peers peers(samples, 0);
    peers.discrete_flying_edges(stages.labels());
    peers.smooth_labels();
    qualities.push_back(
        ways.look("Flying Edges and windowed sinc a label", peers.label_walls(), true));
  }
  return qualities;
}

Json to_json(const std::vector<LabelQuality>& qualities) {
  Json rows = Json::array();
  for (const LabelQuality& one : qualities) {
    const Sharing& sharing = one.sharing;
    Json row = {{"way", one.way},
                {"triangles", one.size.triangles},
                {"gaps", sharing.gaps},
                {"points_within_labels", sharing.points_within_labels},
                {"overlaps", sharing.overlaps},
                {"points", sharing.points}};
    row["change_of_all"] = one.volumes ? Json(one.volumes->all) : Json();
    row["change_of_worst"] = one.volumes ? Json(one.volumes->worst) : Json();
    row["worst_label"] = one.volumes ? Json(one.volumes->worst_label) : Json();
    row["its_voxels"] = one.volumes ? Json(one.volumes->worst_voxels) : Json();
    rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace isomesh::bench
