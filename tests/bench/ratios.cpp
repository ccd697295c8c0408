#include "tests/bench/ratios.h"

#include <algorithm>
#include <array>
#include <functional>
#include <regex>

#include "tests/bench/draco_call.h"
#include "tests/bench/memory.h"
#include "tests/bench/peers.h"
#include "tests/bench/stages.h"
#include "tests/bench/timing.h"

namespace isomesh::bench {
namespace {

constexpr int kPasses = 5;
constexpr Goal kExtractGoal = {0.5};
constexpr Goal kFreshMemoryGoal = {0.6};
constexpr Goal kBccGoal = {1.5};
constexpr Goal kRegularGoal = {1.4};
constexpr Goal kRegularBccGoal = {2};
constexpr Goal kSmoothRateGoal = {200, false};   // Mvertex-passes/s
constexpr Goal kSmoothFactorGoal = {40, false};  // times vtkSmoothPolyDataFilter
constexpr Goal kDrcJobGoal = {0.35};
constexpr Goal kGlbJobGoal = {0.3};
constexpr Goal kStreamGoal = {0.15};
constexpr Goal kStreamOnOneThreadGoal = {0.25};
constexpr Goal kBlocksGoal = {0.12};
constexpr Goal kBytesGoal = {1};
constexpr Goal kDecodeGoal = {1.05};
constexpr Goal kGrowthGoal = {1.1};  // linear within the noise
constexpr std::uint32_t kCompareSize = 256;
constexpr std::uint32_t kMemorySize = 256;
constexpr const char* kPipeline = " / Flying Edges + windowed sinc (20) + Draco";

double rate(const MeshSize& size, int passes, double ms) {
  return static_cast<double>(size.vertices) * passes / ms / 1000;
}

std::string rate_text(double rate) { return fixed(rate, 0) + " Mvp/s"; }

MeshParameters without_normals() {
  MeshParameters parameters;
  parameters.normals = false;
  return parameters;
}

// The findings about one volume.
class Comparison {
 public:
  Comparison(const Samples& samples, double iso, const Plan& plan, std::vector<Finding>& findings)
      : samples_(samples),
        stages_(samples, {.iso = iso}),
        iso_(iso),
        threads_(plan.threads.back()),
        filter_(plan.filter),
        findings_(findings) {
    stages_.extract();
  }

  void run() {
    compare_smoothing();
    compare_with_plain("regularised", Scheme::kSix, true, kRegularGoal);
    compare_with_plain("body-centred", Scheme::kBcc, false, kBccGoal);
    compare_with_plain("body-centred, regularised", Scheme::kBcc, true, kRegularBccGoal);
    compare_encoding();
    if (!peers_available()) return;
    compare_with_peers();
  }

 private:
  bool wanted(const std::string& what) const {
    return std::regex_search(what + ", " + samples_.name, filter_);
  }

  void add(const std::string& what, const Timed& ours, const Timed& theirs, Goal goal) {
    if (!wanted(what)) return;
    findings_.push_back(compared(what + ", " + samples_.name, time_in_pairs(ours, theirs), goal));
  }

  void compare_with_plain(const std::string& what, Scheme scheme, bool regularize, Goal goal) {
    Stages other(samples_, {.iso = iso_, .scheme = scheme, .regularize = regularize});
    add("extraction, " + what + " / plain, 6 tetrahedra", {[&] { other.extract(); }},
        {[&] { stages_.extract(); }}, goal);
  }

  void compare_smoothing() {
    const std::string what = "smoothing, 5 passes with connectivity, Mvertex-passes/s";
    if (!wanted(what)) return;
    const Timed ours = {[&] { stages_.smooth(kPasses); }, [&] { stages_.extract(); }};
    if (!peers_available()) {
      add_rate(what, rate(stages_.size(), kPasses, median_ms(ours, kPairs)));
      return;
    }
    Peers peers(samples_, iso_);
    peers.flying_edges();
    const Paired times = time_in_pairs(ours, {[&] { peers.smooth(kPasses); }});
    const double our_rate = rate(stages_.size(), kPasses, times.ours_ms);
    const double peer_rate = rate(peers.size(), kPasses, times.peer_ms);
    // The meshes differ in size: the ratio of rates is that of times, turned around and scaled.
    const double scale =
        static_cast<double>(stages_.size().vertices) / static_cast<double>(peers.size().vertices);
    add_rate(what, our_rate);
    findings_.push_back({"rate of that / vtkSmoothPolyDataFilter, " + samples_.name,
                         rate_text(our_rate), rate_text(peer_rate), scale / times.ratio,
                         kSmoothFactorGoal});
  }

  void add_rate(const std::string& what, double our_rate) {
    findings_.push_back(
        {what + ", " + samples_.name, rate_text(our_rate), "", our_rate, kSmoothRateGoal});
  }

  // Our streams beside those that libdraco makes of the same smoothed mesh with the same
  // parameters.
  void compare_encoding() {
    stages_.extract();
    stages_.smooth(kPasses);
    const auto peer = [&] {
      return encode_in_one_call(stages_.positions(), stages_.triangles(), DracoParameters{});
    };
    const Timed theirs = {[&] { peer(); }};
    const Timed stream = {[&] { stages_.encode(MeshFormat::kDrc); }};
    add("drc / libdraco, same parameters", stream, theirs, kStreamGoal);
    add("glb / libdraco's one stream",
        {[&] { stages_.encode(MeshFormat::kGlb, without_normals()); }}, theirs, kBlocksGoal);
    set_threads(1);
    add("drc on one thread / libdraco", stream, theirs, kStreamOnOneThreadGoal);
    set_threads(threads_);
    const std::string bytes = "bytes of drc / libdraco's";
    const std::string decoding = "libdraco's decoding of drc / of its own stream";
    if (!wanted(bytes) && !wanted(decoding)) return;
    const std::string ours_drc = stages_.drc();
    const std::string peer_drc = peer();
    findings_.push_back(
        {bytes + ", " + samples_.name, std::to_string(ours_drc.size()),
         std::to_string(peer_drc.size()),
         static_cast<double>(ours_drc.size()) / static_cast<double>(peer_drc.size()), kBytesGoal});
    add(decoding, {[&] { decode_in_one_call(ours_drc); }}, {[&] { decode_in_one_call(peer_drc); }},
        kDecodeGoal);
  }

  void compare_with_peers() {
    Peers peers(samples_, iso_);
    const auto release = [&] { peers.release(); };
    const auto extract = [&] { stages_.extract(); };
    const Timed flying_edges = {[&] { peers.flying_edges(); }, release};
    const Timed pipeline = {[&] { peers.pipeline(); }, release};
    add("extraction, 6 tetrahedra, reused memory / Flying Edges", {extract}, flying_edges,
        kExtractGoal);
    add("extraction, 6 tetrahedra, fresh memory / Flying Edges",
        {extract, [&] { stages_.release_memory(); }}, flying_edges, kFreshMemoryGoal);
    // Exactly the stages of the peers' pipeline; a job also measures quality.
    const auto stages_alone = [&] {
      stages_.extract();
      stages_.smooth(kPasses);
      stages_.encode(MeshFormat::kGlb, without_normals());
    };
    add(std::string("extraction + smoothing + glb") + kPipeline, {stages_alone}, pipeline,
        kGlbJobGoal);
    const auto job = [&](MeshFormat format) {
      return Timed{[&, format] { stages_.run_job(job_to(format, kPasses)); }};
    };
    add(std::string("whole job to drc") + kPipeline, job(MeshFormat::kDrc), pipeline, kDrcJobGoal);
    add(std::string("whole job to glb") + kPipeline, job(MeshFormat::kGlb), pipeline, kGlbJobGoal);
  }

  const Samples& samples_;
  Stages stages_;
  const double iso_;
  const int threads_;
  const std::regex filter_;
  std::vector<Finding>& findings_;
};

Finding growth_of_time(const std::vector<std::uint32_t>& sizes) {
  std::vector<std::array<double, 2>> points;
  for (const std::uint32_t size : sizes) {
    const Samples field = synthetic_field(size);
    Stages stages(field, {.iso = kFieldIso});
    stages.extract();  // to warm up
    const auto both = [&] {
      stages.extract();
      stages.smooth(kPasses);
    };
    constexpr int kRuns = 5;
    const double ms = median_ms({both}, kRuns);
    points.push_back({static_cast<double>(field.dims.samples() + stages.size().triangles), ms});
  }
  return {"exponent of extraction + smoothing time over samples + triangles, " +
              std::to_string(sizes.front()) + "^3 to " + std::to_string(sizes.back()) + "^3",
          milliseconds(points.front()[1]) + " .. " + milliseconds(points.back()[1]), "",
          log_log_slope(points), kGrowthGoal};
}

// Peak over input + output + O(slice): what each thread may hold of planes while it walks through
// them, what smoothing says that it takes of layers, and a little that does not grow at all.
std::optional<Finding> memory_of(const std::string& stage, int threads) {
  const auto memory = measure_memory(stage, std::to_string(kMemorySize), threads);
  if (!memory) return std::nullopt;
  constexpr std::uint64_t kBytesPerPlaneSample = 16;
  constexpr std::uint64_t kConstant = 4 << 20;
  std::uint64_t slices =
      static_cast<std::uint64_t>(threads) * kBytesPerPlaneSample * kMemorySize * kMemorySize;
  if (stage == kSmoothStage) slices += memory->layer_bytes;
  const auto allowed =
      static_cast<double>(memory->input_bytes + memory->output_bytes + slices + kConstant);
  return Finding{"peak memory of " + stage + " / (input + output + slices), field-" +
                     std::to_string(kMemorySize),
                 mebibytes(memory->peak_bytes), "",
                 static_cast<double>(memory->peak_bytes) / allowed, Goal{1}};
}

}  // namespace

std::vector<Finding> measure_ratios(const Plan& plan) {
  const int threads = plan.threads.back();
  set_threads(threads);
  Peers::set_threads(threads);

  std::vector<Finding> findings;
  if (plan.volume) Comparison(*plan.volume, plan.iso, plan, findings).run();
  const auto& sizes = plan.field_sizes;
  if (!sizes.empty()) {
    const bool has_usual = std::ranges::find(sizes, kCompareSize) != sizes.end();
    const Samples field = synthetic_field(has_usual ? kCompareSize : sizes.front());
    Comparison(field, kFieldIso, plan, findings).run();
  }
  const std::regex filter(plan.filter);
  constexpr std::size_t kFewestForGrowth = 3;
  if (sizes.size() >= kFewestForGrowth && std::regex_search("exponent of time", filter)) {
    findings.push_back(growth_of_time(sizes));
  }
  if (!std::regex_search("peak memory", filter)) return findings;
  for (const char* stage : {kExtractStage, kSmoothStage}) {
    if (const auto finding = memory_of(stage, threads)) findings.push_back(*finding);
  }
  return findings;
}

}  // namespace isomesh::bench
