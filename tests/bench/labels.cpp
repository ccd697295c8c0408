#include "tests/bench/labels.h"

#include "tests/bench/label_body.h"
#include "tests/bench/label_stages.h"
#include "tests/bench/memory.h"
#include "tests/bench/peers.h"
#include "tests/bench/stages.h"
#include "tests/bench/surface_nets.h"
#include "tests/bench/timing.h"

namespace isomesh::bench {
namespace {

namespace fs = std::filesystem;

constexpr Goal kPerLabelGoal = {0.1};
// Beside SurfaceNets with its 16 passes.
constexpr Goal kStairsGoal = {1.7};
constexpr Goal kLaplacianGoal = {0.5};
constexpr Goal kJobGoal = {2.5};
constexpr Goal kMemoryGoal = {1.2};
constexpr int kLabelPairs = 3;

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
    add("voxels and bounds of each", {[&] { stages_.count_voxels(); }});
    add("topology, area and volume of each", {[&] { stages_.measure(); }});
    const std::uint64_t triangles = stages_.size().triangles;
    findings_.push_back({"triangles, " + which_,
                         std::to_string(triangles),
                         "",
                         static_cast<double>(triangles),
                         {}});
    return std::move(findings_);
  }

 private:
  void extract_and_smooth() {
    stages_.extract();
    stages_.smooth(laplacian_by_labels(samples_));
  }
  void extract_and_remove_stairs() {
    stages_.extract();
    stages_.remove_stairs();
  }

  void add_time(const std::string& what, double ms) {
    findings_.push_back(timed(what + ", " + which_, ms));
  }
  void add(const std::string& what, const Timed& ours) {
    add_time(what, median_ms(ours, kLabelPairs));
  }
  void add(const std::string& what, const Paired& times, std::optional<Goal> goal) {
    findings_.push_back(compared(what + ", " + which_, times, goal));
  }

  // Adds the time of stair removal alone and of each stage of a job.
  void add_stages() {
    add("the stairs of all alone", {[&] { stages_.remove_stairs(); }, [&] { stages_.extract(); }});
    stages_.run_job();
    const Timing timing = stages_.run_job().timing;
    add_time("extract of a job to a GLB", timing.extract);
    add_time("smooth of a job to a GLB", timing.smooth);
    add_time("encode of a job to a GLB", timing.encode);
  }

  void compare_surface_nets() {
    if (plan_.surface_nets_root.empty()) return;
    SurfaceNets nets(plan_.surface_nets_root, samples_, stages_.labels(), plan_.threads);
    const auto compare = [&](const std::string& what, const Timed& ours, std::optional<Goal> goal) {
      time_ms(ours);
      add(what + " / SurfaceNets with 16 passes",
          pair_times([&] { return time_ms(ours); }, [&] { return nets.run_ms(); }, kLabelPairs),
          goal);
    };
    const Timed stairs = {[&] { stages_.remove_stairs(); }, [&] { stages_.extract(); }};
    compare("smoothing alone", stairs, {});
    compare("extraction + smoothing", {[&] { extract_and_remove_stairs(); }}, kStairsGoal);
    compare("extraction + 10 Laplacian passes", {[&] { extract_and_smooth(); }}, kLaplacianGoal);
    compare("job to a GLB", {[&] { stages_.run_job(); }}, kJobGoal);
    compare_memory(nets);
  }

  void compare_memory(const SurfaceNets& nets) {
    const auto ours = measure_memory(kLabelJobStage, samples_.source, plan_.threads);
    if (!ours) return;
    const double ratio =
        static_cast<double>(ours->peak_bytes) / static_cast<double>(nets.peak_bytes());
    findings_.push_back({"peak memory of a job to a GLB / SurfaceNets, " + which_,
                         mebibytes(ours->peak_bytes), mebibytes(nets.peak_bytes()), ratio,
                         kMemoryGoal});
  }

  void compare_flying_edges() {
    const Timed bare = {[&] { stages_.extract(); }};
    const Timed smoothed = {[&] { extract_and_smooth(); }};
    if (!peers_available()) {
      add("extraction of all", bare);
      add("the same and 10 passes of smoothing", smoothed);
      return;
    }
    Peers peers(samples_, 0);
    const auto release = [&] { peers.release(); };
    const auto surfaces = [&] { peers.discrete_flying_edges(stages_.labels()); };
    const auto smooth_surfaces = [&] {
      surfaces();
      peers.smooth_labels();
    };
    add("extraction of all / discrete Flying Edges a label",
        time_in_pairs(bare, {surfaces, release}, kLabelPairs), kPerLabelGoal);
    add("with 10 passes of smoothing / with windowed sinc a label",
        time_in_pairs(smoothed, {smooth_surfaces, release}, kLabelPairs), {});
  }

  const Samples& samples_;
  const LabelPlan& plan_;
  LabelStages stages_;
  std::string which_;
  std::vector<Finding> findings_;
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

}  // namespace isomesh::bench
