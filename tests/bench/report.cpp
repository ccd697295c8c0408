#include "tests/bench/report.h"

#include <algorithm>
#include <iostream>
#include <numeric>

#include "tests/bench/accuracy.h"
#include "tests/bench/ct_head.h"
#include "tests/bench/lattices.h"
#include "tests/bench/machine.h"
#include "tests/bench/memory.h"
#include "tests/bench/paper_tables.h"
#include "tests/bench/peers.h"
#include "tests/bench/ratios.h"
#include "tests/bench/service.h"
#include "tests/bench/stages.h"
#include "tests/bench/timing.h"

namespace isomesh::bench {
namespace {

constexpr const char* kBrainFile = "/usr/share/mricron/templates/ch2.nii.gz";
constexpr double kBrainIso = 60;
constexpr int kPasses = 5;
constexpr int kRuns = 5;

// The share that the first bins have.
double share_below(const Distribution& values, std::size_t bins) {
  const auto sum = [](auto begin, auto end) {
    return static_cast<double>(std::accumulate(begin, end, std::uint64_t{0}));
  };
  const auto& all = values.histogram;
  return sum(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(bins)) /
         sum(all.begin(), all.end());
}

// Triangles whose aspect ratio is below 0.3 count as poor.
double poor_share(const Distribution& ratios) {
  constexpr std::size_t kPoorBins = 6;
  static_assert(10 * kPoorBins == 3 * Distribution::kBins);
  return share_below(ratios, kPoorBins);
}

// Triangles with an angle below 21 degrees.
double small_share(const Distribution& angles) {
  constexpr std::size_t kSmallBins = 7;  // of 3 degrees
  return share_below(angles, kSmallBins);
}

std::vector<Surface> ways_to_extract(double iso, bool close) {
  std::vector<Surface> ways;
  for (const Scheme scheme : {Scheme::kFive, Scheme::kSix}) {
    for (const Interpolation way : {Interpolation::kLinear, Interpolation::kMidpoint}) {
      ways.push_back({iso, scheme, way, close});
    }
  }
  return ways;
}

Json row_of(const Subject& subject, const Surface& surface) {
  return {{"volume", title_of(subject.samples, subject.levels.front())},
          {"tetrahedra", surface.scheme == Scheme::kFive ? 5 : 6},
          {"interpolation", to_string(surface.interpolation)}};
}

// Measures how scheme and interpolation affect the mesh.
Json measure_choices(const Subject& subject) {
  Json rows = Json::array();
  for (const Surface& surface : ways_to_extract(subject.levels.front().iso, false)) {
    Stages stages(subject.samples, surface);
    stages.extract();  // to warm up
    Json row = row_of(subject, surface);
    row["triangles"] = stages.size().triangles;
    row["extract_ms"] = median_ms({[&] { stages.extract(); }}, kRuns);
    const Distribution extracted = stages.shapes().aspect_ratio;
    const double extracted_mm3 = stages.volume_mm3();
    row["smooth_ms"] =
        median_ms({[&] { stages.smooth(kPasses); }, [&] { stages.extract(); }}, kRuns);
    const Distribution smoothed = stages.shapes().aspect_ratio;
    row["drc_bytes"] = stages.encode(Encoding::kEdgebreakerWhole);
    row["aspect_ratio_before"] = extracted.mean;
    row["aspect_ratio_after"] = smoothed.mean;
    row["poor_before"] = poor_share(extracted);
    row["poor_after"] = poor_share(smoothed);
    row["volume_kept"] = stages.volume_mm3() / extracted_mm3;
    rows.push_back(row);
  }
  return rows;
}

// Aspect ratios, angles and enclosed volume against passes, for each kind of smoothing.
Json measure_quality(const Subject& subject) {
  Json rows = Json::array();
  for (const Smoothing smoothing : values_of<Smoothing>()) {
    for (const Surface& surface : ways_to_extract(subject.levels.front().iso, true)) {
      Stages stages(subject.samples, surface);
      for (const int passes : {0, 1, 2, 5, 10, 20}) {
        stages.extract();
        const double extracted_mm3 = stages.volume_mm3();
        const double smooth_ms =
            median_ms({[&] { stages.smooth(passes, smoothing); }, [&] { stages.extract(); }}, 1);
        stages.smooth(passes, smoothing);
        const mesh::Shapes shapes = stages.shapes();
        Json row = row_of(subject, surface);
        row["smoothing"] = to_string(smoothing);
        row["passes"] = passes;
        row["aspect_ratio"] = shapes.aspect_ratio.mean;
        row["poor"] = poor_share(shapes.aspect_ratio);
        row["smallest_angle_deg"] = shapes.smallest_angle_deg.mean;
        row["small_angles"] = small_share(shapes.smallest_angle_deg);
        row["smooth_ms"] = smooth_ms;
        row["least_angle_deg"] = shapes.smallest_angle_deg.min;
        row["volume_kept"] = stages.volume_mm3() / extracted_mm3;
        rows.push_back(row);
      }
    }
  }
  return rows;
}

// Time and peak memory of the synthetic field of one size.
Json measure_growth(std::uint32_t size, int threads) {
  constexpr int kJobRuns = 3;
  Json row = {{"size", size}};
  const Samples field = synthetic_field(size);
  {
    Stages stages(field, {.iso = kFieldIso});
    stages.extract();
    stages.smooth(kPasses);
    row["samples"] = field.dims.samples();
    row["triangles"] = stages.size().triangles;
    row["extract_ms"] = median_ms({[&] { stages.extract(); }}, kRuns);
    row["smooth_ms"] =
        median_ms({[&] { stages.smooth(kPasses); }, [&] { stages.extract(); }}, kRuns);
    row["job_ms"] = median_ms({[&] { stages.run_job(kPasses, MeshFormat::kDrc); }}, kJobRuns);
  }
  std::vector<std::pair<std::string, std::string>> stages = {
      {"extract", kExtractStage}, {"smooth", kSmoothStage}, {"job", kJobStage}};
  if (peers_available()) {
    Peers peers(field, kFieldIso);
    const auto release = [&] { peers.release(); };
    row["peer_extract_ms"] = median_ms({[&] { peers.flying_edges(); }, release}, kRuns);
    row["peer_job_ms"] = median_ms({[&] { peers.pipeline(); }, release}, kJobRuns);
    stages.insert(stages.end(), {{"peer_extract", kPeerExtractStage}, {"peer_job", kPeerJobStage}});
  }
  for (const auto& [name, stage] : stages) {
    const auto memory = measure_memory(stage, std::to_string(size), threads);
    if (name == "extract" && memory) {
      row["least_bytes"] = memory->input_bytes + memory->output_bytes;
    }
    row[name + "_bytes"] = memory ? Json(memory->peak_bytes) : Json();
  }
  return row;
}

Json measure_accuracy(const Subject& subject, const Subject::Level& level, int threads) {
  AccuracyPlan plan;
  plan.iso = level.iso;
  plan.threads = threads;
  Json rows = Json::array();
  for (const Json& found : to_json(measure_approximations(subject.samples, plan))) {
    Json row = {{"volume", title_of(subject.samples, level)}};
    row.update(found);
    rows.push_back(row);
  }
  return rows;
}

// Measures section by section, saying which.
class Report {
 public:
  explicit Report(const ReportPlan& plan) : plan_(plan) {}

  bool wants(const std::string& section) const {
    return plan_.sections.empty() ||
           std::ranges::find(plan_.sections, section) != plan_.sections.end();
  }

  template <class Measure>
  void add(const std::string& table, Measure measure) {
    std::cerr << "isomesh-bench: " << table << std::endl;
    Json& rows = document[table];
    for (const Json& row : measure()) rows.push_back(row);
  }

  Json document;

 private:
  const ReportPlan& plan_;
};

void measure_against_the_paper(const ReportPlan& plan, Report& report) {
  const Subject& head = *plan.head;
  const auto& triangles = plan.paper_triangles;
  report.add("unique", [&] { return measure_unique(head, plan.cubes); });
  report.add("sub_tables", [&] { return measure_sub_tables(head, triangles); });
  report.add("without_sub_tables",
             [&] { return measure_without_sub_tables(head, triangles.front()); });
  report.add("generation", [&] { return measure_generation(head, triangles); });
}

}  // namespace

std::string title_of(const Samples& samples, const Subject::Level& level) {
  return samples.name + " " + std::to_string(samples.dims.x) + "x" +
         std::to_string(samples.dims.y) + "x" + std::to_string(samples.dims.z) + ", " + level.name;
}

ReportPlan usual_plan(const std::filesystem::path& daemon) {
  ReportPlan plan;
  plan.threads = std::min(2, processors());
  plan.daemon = daemon;
  plan.brain_file = kBrainFile;
  if (std::filesystem::exists(kCtHeadFile)) {
    plan.head = Subject{read_inv3(kCtHeadFile),
                        {{"skin at -300 HU", kSkinIso}, {"bone at 250 HU", kBoneIso}}};
  }
  if (std::filesystem::exists(kBrainFile)) {
    plan.brain = Subject{load_volume(kBrainFile).samples, {{"iso 60", kBrainIso}}};
    plan.brain->samples.name = "ch2";
  }
  return plan;
}

Json measure_report(const ReportPlan& plan) {
  set_threads(plan.threads);
  Peers::set_threads(plan.threads);
  Report report(plan);
  for (const auto& [key, value] : describe_machine()) report.document["machine"][key] = value;
  report.document["threads"] = plan.threads;

  Plan goals;
  goals.threads = {plan.threads};
  goals.field_sizes = {64, 128, 256, 512};
  std::vector<Subject> subjects;
  if (plan.head) {
    const std::uint32_t n = plan.cubes.back();
    subjects.push_back({resample(plan.head->samples, {n, n, n}), plan.head->levels});
  }
  if (plan.brain) {
    goals.volume = plan.brain->samples;
    goals.iso = plan.brain->levels.front().iso;
    subjects.push_back(*plan.brain);
  }
  report.document["volumes"] = Json::array();
  for (const Subject& subject : subjects) {
    report.document["volumes"].push_back(subject.samples.name);
  }

  if (plan.brain && report.wants("service")) {
    report.add("service", [&] {
      return to_json(measure_service({plan.daemon, plan.brain_file, goals.iso, plan.threads}));
    });
  }
  if (report.wants("goals")) report.add("goals", [&] { return to_json(measure_findings(goals)); });
  if (plan.head && report.wants("paper")) measure_against_the_paper(plan, report);
  for (const Subject& subject : subjects) {
    if (report.wants("paper")) report.add("schemes", [&] { return measure_schemes(subject); });
    if (report.wants("passes")) {
      report.add("passes", [&] {
        return measure_passes(subject, std::array{0, 1, 2, 5, 10, 15, 20});
      });
    }
    if (report.wants("quality")) {
      report.add("choices", [&] { return measure_choices(subject); });
      report.add("quality", [&] { return measure_quality(subject); });
    }
  }
  if (report.wants("lattices")) {
    report.add("lattices", [] { return measure_lattices(ball_subject()); });
    if (plan.brain) report.add("lattices", [&] { return measure_lattices(*plan.brain); });
  }
  if (report.wants("growth")) {
    for (const std::uint32_t size : plan.growth) {
      report.add("growth", [&] { return Json::array({measure_growth(size, plan.threads)}); });
    }
  }
  if (!report.wants("accuracy")) return report.document;
  for (const auto& subject : {plan.brain, plan.head}) {
    if (!subject) continue;
    report.add("accuracy",
               [&] { return measure_accuracy(*subject, subject->levels.back(), plan.threads); });
  }
  return report.document;
}

}  // namespace isomesh::bench
