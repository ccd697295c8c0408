#include "tests/bench/ratios.h"

#include <algorithm>
#include <array>
#include <functional>
#include <iomanip>
#include <regex>
#include <sstream>

#include "tests/bench/draco_call.h"
#include "tests/bench/memory.h"
#include "tests/bench/numbers.h"
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

double rate(const MeshSize& size, int passes, double ms) {
  return static_cast<double>(size.vertices) * passes / ms / 1000;
}

std::string rate_text(double rate) { return fixed(rate, 0) + " Mvp/s"; }

// The findings about one volume.
class Comparison {
 public:
  Comparison(const Samples& samples, double iso, int threads,
             const std::function<bool(std::string)>& wanted, std::vector<Finding>& findings)
      : samples_(samples),
        stages_(samples, {.iso = iso}),
        iso_(iso),
        threads_(threads),
        wanted_(wanted),
        findings_(findings) {
    stages_.extract();
  }

  void run() {
    if (wanted("smooth_rate")) compare_smoothing();
    compare_with_plain("extract_regular", "regularised", Scheme::kSix, true, kRegularGoal);
    compare_with_plain("extract_bcc", "body-centred", Scheme::kBcc, false, kBccGoal);
    compare_with_plain("extract_bcc_regular", "body-centred, regularised", Scheme::kBcc, true,
                       kBccGoal);
    compare_encoding();
    if (!peers_available()) return;
    if (wanted("extract_reused_memory")) compare_extraction("extract_reused_memory", false);
    if (wanted("extract_fresh_memory")) compare_extraction("extract_fresh_memory", true);
    if (wanted("stages_glb")) compare_stages();
    for (const MeshFormat format : {MeshFormat::kDrc, MeshFormat::kGlb}) {
      const std::string name = "job_" + std::string(to_string(format));
      if (wanted(name)) compare_job(name, format);
    }
  }

 private:
  std::string full(const std::string& name) const { return "ratio/" + name + "/" + samples_.name; }
  bool wanted(const std::string& name) const { return wanted_(full(name)); }

  void add(const std::string& name, const std::string& what, const Paired& times, Goal goal) {
    findings_.push_back({full(name), what + ", " + samples_.name, milliseconds(times.ours_ms),
                         milliseconds(times.peer_ms), times.ratio, goal});
  }

  void compare_extraction(const std::string& name, bool fresh) {
    Peers peers(samples_, iso_);
    const Timed ours = {[&] { stages_.extract(); },
                        [&, fresh] {
                          if (fresh) stages_.release_memory();
                        }};
    const Timed theirs = {[&] { peers.flying_edges(); }, [&] { peers.release(); }};
    add(name,
        std::string("extraction, 6 tetrahedra, ") + (fresh ? "fresh" : "reused") +
            " memory / Flying Edges",
        time_in_pairs(ours, theirs), fresh ? kFreshMemoryGoal : kExtractGoal);
  }

  void compare_with_plain(const std::string& name, const std::string& what, Scheme scheme,
                          bool regularize, Goal goal) {
    if (!wanted(name)) return;
    Stages other(samples_, {.iso = iso_, .scheme = scheme, .regularize = regularize});
    const Timed ours = {[&] { other.extract(); }};
    const Timed plain = {[&] { stages_.extract(); }};
    add(name, "extraction, " + what + " / plain, 6 tetrahedra", time_in_pairs(ours, plain), goal);
  }

  void compare_smoothing() {
    const Timed ours = {[&] { stages_.smooth(kPasses); }, [&] { stages_.extract(); }};
    const std::string what = "smoothing, 5 passes with connectivity";
    if (!peers_available()) {
      const double ms = median_ms(ours, kPairs);
      add_rate(what, rate(stages_.size(), kPasses, ms));
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
    findings_.push_back(
        {full("smooth_factor"), "rate of that / vtkSmoothPolyDataFilter, " + samples_.name,
         rate_text(our_rate), rate_text(peer_rate), scale / times.ratio, kSmoothFactorGoal});
  }

  void add_rate(const std::string& what, double our_rate) {
    findings_.push_back({full("smooth_rate"), what + ", Mvertex-passes/s, " + samples_.name,
                         rate_text(our_rate), "", our_rate, kSmoothRateGoal});
  }

  // Our streams beside those that libdraco makes of the same smoothed mesh with the same
  // parameters.
  void compare_encoding() {
    if (!wanted("draco_stream") && !wanted("draco_stream_one_thread") && !wanted("draco_blocks") &&
        !wanted("draco_bytes") && !wanted("draco_decode")) {
      return;
    }
    stages_.extract();
    stages_.smooth(kPasses);
    const auto peer = [&] {
      return encode_in_one_call(stages_.positions(), stages_.triangles(), DracoParameters{});
    };
    const Timed theirs = {[&] { peer(); }};
    const Timed stream = {[&] { stages_.encode(Encoding::kEdgebreakerWhole); }};
    const Timed blocks = {[&] { stages_.encode(Encoding::kEdgebreakerChunks); }};
    if (wanted("draco_stream")) {
      add("draco_stream", "drc / libdraco, same parameters", time_in_pairs(stream, theirs),
          kStreamGoal);
    }
    if (wanted("draco_blocks")) {
      add("draco_blocks", "glb / libdraco's one stream", time_in_pairs(blocks, theirs),
          kBlocksGoal);
    }
    if (wanted("draco_stream_one_thread")) {
      set_threads(1);
      add("draco_stream_one_thread", "drc on one thread / libdraco", time_in_pairs(stream, theirs),
          kStreamOnOneThreadGoal);
      set_threads(threads_);
    }
    const std::string ours_drc = stages_.drc();
    const std::string peer_drc = peer();
    if (wanted("draco_bytes")) {
      findings_.push_back(
          {full("draco_bytes"), "bytes of drc / libdraco's, " + samples_.name,
           std::to_string(ours_drc.size()), std::to_string(peer_drc.size()),
           static_cast<double>(ours_drc.size()) / static_cast<double>(peer_drc.size()),
           kBytesGoal});
    }
    if (wanted("draco_decode")) {
      add("draco_decode", "libdraco's decoding of drc / of its own stream",
          time_in_pairs({[&] { decode_in_one_call(ours_drc); }},
                        {[&] { decode_in_one_call(peer_drc); }}),
          kDecodeGoal);
    }
  }

  // Compares exactly the stages of the peers' pipeline; a job also measures quality.
  void compare_stages() {
    Peers peers(samples_, iso_);
    const Timed ours = {[&] {
      stages_.extract();
      stages_.smooth(kPasses);
      stages_.encode(Encoding::kEdgebreakerChunks);
    }};
    const Timed theirs = {[&] { peers.pipeline(); }, [&] { peers.release(); }};
    add("stages_glb", "extraction + smoothing + glb / Flying Edges + windowed sinc (20) + Draco",
        time_in_pairs(ours, theirs), kGlbJobGoal);
  }

  void compare_job(const std::string& name, MeshFormat format) {
    Peers peers(samples_, iso_);
    const Timed ours = {[&] { stages_.run_job(kPasses, format); }};
    const Timed theirs = {[&] { peers.pipeline(); }, [&] { peers.release(); }};
    add(name,
        "whole job to " + std::string(to_string(format)) +
            " / Flying Edges + windowed sinc (20) + Draco",
        time_in_pairs(ours, theirs), format == MeshFormat::kDrc ? kDrcJobGoal : kGlbJobGoal);
  }

  const Samples& samples_;
  Stages stages_;
  double iso_;
  int threads_;
  const std::function<bool(std::string)>& wanted_;
  std::vector<Finding>& findings_;
};

Finding growth_of_time(const std::vector<std::uint32_t>& sizes) {
  std::vector<std::array<double, 2>> points;
  std::string ours;
  for (const std::uint32_t size : sizes) {
    const Samples field = synthetic_field(size);
    Stages stages(field, {.iso = kFieldIso});
    stages.extract();  // to warm up
    constexpr int kRuns = 5;
    const double ms = median_ms({[&] {
                                  stages.extract();
                                  stages.smooth(kPasses);
                                }},
                                kRuns);
    points.push_back({static_cast<double>(field.dims.samples() + stages.size().triangles), ms});
  }
  ours = milliseconds(points.front()[1]) + " .. " + milliseconds(points.back()[1]);
  return {"ratio/growth_of_time",
          "exponent of extraction + smoothing time over samples + triangles, " +
              std::to_string(sizes.front()) + "^3 to " + std::to_string(sizes.back()) + "^3",
          ours,
          "",
          log_log_slope(points),
          kGrowthGoal};
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
  return Finding{"ratio/memory_" + stage,
                 "peak memory of " +
                     std::string(stage == kExtractStage ? "extraction" : "extraction + smoothing") +
                     " / (input + output + slices), field-" + std::to_string(kMemorySize),
                 mebibytes(memory->peak_bytes),
                 "",
                 static_cast<double>(memory->peak_bytes) / allowed,
                 Goal{1}};
}

}  // namespace

bool Finding::reached() const {
  return !goal || (goal->at_most ? value <= goal->value : value >= goal->value);
}

std::vector<Finding> measure_findings(const Plan& plan) {
  const std::regex filter(plan.filter);
  const std::function<bool(std::string)> wanted = [&](const std::string& name) {
    return std::regex_search(name, filter);
  };
  const int threads = plan.threads.back();
  set_threads(threads);
  Peers::set_threads(threads);

  std::vector<Finding> findings;
  if (plan.volume) Comparison(*plan.volume, plan.iso, threads, wanted, findings).run();
  const auto& sizes = plan.field_sizes;
  if (!sizes.empty()) {
    const bool has_usual = std::ranges::find(sizes, kCompareSize) != sizes.end();
    const Samples field = synthetic_field(has_usual ? kCompareSize : sizes.front());
    Comparison(field, kFieldIso, threads, wanted, findings).run();
  }
  constexpr std::size_t kFewestForGrowth = 3;
  if (sizes.size() >= kFewestForGrowth && wanted("ratio/growth_of_time")) {
    findings.push_back(growth_of_time(sizes));
  }
  for (const char* stage : {kExtractStage, kSmoothStage}) {
    if (!wanted(std::string("ratio/memory_") + stage)) continue;
    if (const auto finding = memory_of(stage, threads)) findings.push_back(*finding);
  }
  return findings;
}

std::string to_table(const std::vector<Finding>& findings) {
  std::size_t width = 0;
  for (const Finding& finding : findings) width = std::max(width, finding.what.size());
  std::ostringstream text;
  const auto row = [&](const std::string& what, const std::string& ours, const std::string& peer,
                       const std::string& value, const std::string& goal,
                       const std::string& verdict) {
    text << std::left << std::setw(static_cast<int>(width) + 2) << what << std::right
         << std::setw(20) << ours << std::setw(12) << peer << std::setw(9) << value << std::setw(10)
         << goal << "  " << verdict << '\n';
  };
  row("", "isomesh", "peer", "value", "goal", "");
  for (const Finding& finding : findings) {
    const std::string goal =
        finding.goal ? (finding.goal->at_most ? "<= " : ">= ") + fixed(finding.goal->value, 2) : "";
    row(finding.what, finding.ours, finding.peer, fixed(finding.value, finding.value < 10 ? 2 : 0),
        goal,
        !finding.goal       ? ""
        : finding.reached() ? "reached"
                            : "NOT REACHED");
  }
  return text.str();
}

Json to_json(const std::vector<Finding>& findings) {
  Json rows = Json::array();
  for (const Finding& finding : findings) {
    Json row = {{"name", finding.name},
                {"what", finding.what},
                {"isomesh", finding.ours},
                {"value", finding.value}};
    if (!finding.peer.empty()) row["peer"] = finding.peer;
    if (finding.goal) {
      row[finding.goal->at_most ? "goal_at_most" : "goal_at_least"] = finding.goal->value;
      row["reached"] = finding.reached();
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace isomesh::bench
