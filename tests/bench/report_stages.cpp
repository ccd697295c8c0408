#include <array>
#include <optional>
#include <utility>

#include "tests/bench/experiments.h"
#include "tests/bench/numbers.h"
#include "tests/bench/peers.h"
#include "tests/bench/report_sections.h"
#include "tests/bench/report_text.h"
#include "tests/bench/timing.h"

namespace isomesh::bench {
namespace {

using Rows = std::vector<std::vector<std::string>>;

std::string cube_name(std::uint32_t size) { return std::to_string(size) + "^3"; }

struct TimeLine {
  const char* label;
  double GrowthFigures::*ms;
};

struct MemoryLine {
  const char* label;
  std::optional<PeakMemory> GrowthFigures::*memory;
};

std::vector<TimeLine> time_lines() {
  std::vector<TimeLine> lines = {{"extraction", &GrowthFigures::extract_ms},
                                 {"smoothing", &GrowthFigures::smooth_ms},
                                 {"whole job", &GrowthFigures::job_ms}};
  if (peers_available()) {
    lines.push_back({"Flying Edges", &GrowthFigures::peer_extract_ms});
    lines.push_back({"VTK + Draco", &GrowthFigures::peer_job_ms});
  }
  return lines;
}

std::vector<MemoryLine> memory_lines() {
  std::vector<MemoryLine> lines = {{"extraction", &GrowthFigures::extract_memory},
                                   {"extraction + smoothing", &GrowthFigures::smooth_memory},
                                   {"whole job", &GrowthFigures::job_memory}};
  if (peers_available()) {
    lines.push_back({"Flying Edges", &GrowthFigures::peer_extract_memory});
    lines.push_back({"VTK + Draco", &GrowthFigures::peer_job_memory});
  }
  return lines;
}

void write_growth_of_time(const std::vector<GrowthFigures>& all, Document& document) {
  Plot plot = {.title = "Time against size, " + cube_name(all.front().size) + " to " +
                        cube_name(all.back().size),
               .x = {"samples + triangles", Scale::kLog},
               .y = {"time, ms", Scale::kLog},
               .series = {}};
  std::vector<std::string> head = {"time", "triangles"};
  Rows rows;
  for (const GrowthFigures& one : all) {
    rows.push_back({cube_name(one.size), grouped(one.mesh.triangles)});
  }
  for (const TimeLine& line : time_lines()) {
    std::vector<std::array<double, 2>> points;
    for (std::size_t i = 0; i < all.size(); ++i) {
      points.push_back({static_cast<double>(all[i].work), all[i].*line.ms});
      rows[i].push_back(milliseconds(all[i].*line.ms));
    }
    const double slope = log_log_slope(points);
    head.emplace_back(line.label);
    plot.series.push_back(
        {std::string(line.label) + ", slope " + fixed(slope, 2), std::move(points)});
  }
  document.plot("time-against-size", plot);
  document.table(head, rows);
}

void write_growth_of_memory(const std::vector<GrowthFigures>& all, Document& document) {
  Plot plot = {.title = "Peak memory against size",
               .x = {"samples along each axis", Scale::kLog},
               .y = {"MiB", Scale::kLog},
               .series = {}};
  std::vector<std::string> head = {"peak memory", "samples + mesh"};
  Rows rows;
  for (const GrowthFigures& one : all) {
    plot.x.ticks.push_back(one.size);
    const auto& least = one.extract_memory;
    rows.push_back(
        {cube_name(one.size), least ? mebibytes(least->input_bytes + least->output_bytes) : "-"});
  }
  for (const MemoryLine& line : memory_lines()) {
    Series series = {line.label, {}};
    for (std::size_t i = 0; i < all.size(); ++i) {
      const std::optional<PeakMemory>& memory = all[i].*line.memory;
      rows[i].push_back(memory ? mebibytes(memory->peak_bytes) : "-");
      if (!memory) continue;
      series.points.push_back(
          {static_cast<double>(all[i].size), static_cast<double>(memory->peak_bytes) / (1 << 20)});
    }
    head.emplace_back(line.label);
    plot.series.push_back(std::move(series));
  }
  document.plot("memory-against-size", plot);
  document.table(head, rows);
}

}  // namespace

void write_passes(const Subject& subject, Report& report) {
  const Subject::Level& level = subject.levels.front();
  const std::string title = title_of(subject.samples, level);
  say("passes, " + title);
  report.document.heading("Time against passes: " + title);
  report.document.paragraph(
      "Extraction included. VTK's filters work on the Flying Edges mesh, which is a third the "
      "size. The paper took 37.6 s for 5 and 39.85 s for 10 passes on 337 863 triangles: the "
      "passes themselves were cheap there, too.");
  constexpr std::array kCounts = {0, 1, 2, 5, 10, 15, 20};
  Series ours = {"isomesh, 6 tetrahedra", {}};
  Series smooth = {"Flying Edges + vtkSmooth", {}};
  Series sinc = {"Flying Edges + windowed sinc", {}};
  Rows rows;
  for (const PassesFigures& figure : measure_passes(subject.samples, level.iso, kCounts)) {
    const double passes = figure.passes;
    ours.points.push_back({passes, figure.ours_ms});
    smooth.points.push_back({passes, figure.peer_smooth_ms});
    sinc.points.push_back({passes, figure.peer_sinc_ms});
    rows.push_back({std::to_string(figure.passes), milliseconds(figure.ours_ms),
                    peer_time(figure.peer_smooth_ms), peer_time(figure.peer_sinc_ms)});
  }
  Plot plot = {.title = "Extraction and smoothing, " + title,
               .x = {"passes", Scale::kLinear},
               .y = {"time, ms", Scale::kLog},
               .series = {ours}};
  if (peers_available()) {
    plot.series.push_back(smooth);
    plot.series.push_back(sinc);
  }
  report.document.plot("passes-" + subject.samples.name, plot);
  report.document.table({"passes", "isomesh", "Flying Edges + vtkSmoothPolyDataFilter",
                         "Flying Edges + windowed sinc"},
                        rows);
}

void write_growth(std::span<const std::uint32_t> sizes, Report& report) {
  std::vector<GrowthFigures> all;
  for (const std::uint32_t size : sizes) {
    say("growth, " + cube_name(size));
    all.push_back(measure_growth(size, report.threads));
  }
  report.document.heading("Time and memory against size");
  report.document.paragraph(
      "A synthetic field of n^3 uint8 samples whose surface grows with n^2; six tetrahedra, five "
      "passes. Time is drawn against samples + triangles: the slope of a straight line on these "
      "axes is the exponent of growth, and 1 is linear. The paper tells times for two sizes only, "
      "37.6 s and 4.58 s for 337 863 and 71 795 triangles: a slope of 1.36.");
  write_growth_of_time(all, report.document);
  report.document.paragraph(
      "Memory is the peak of a process of its own that holds the samples and runs the stage once: "
      "samples included, program and libraries not. *Samples + mesh* is what cannot be avoided.");
  write_growth_of_memory(all, report.document);
}

void write_goals(const Plan& plan, Report& report) {
  say("goals");
  report.document.heading("Against the peers and the goals");
  report.document.paragraph(
      "The kernels and a job's way through them in this process, without the service. Ratios are "
      "medians "
      "over pairs of runs, ours and the peer's in turn, memory as the daemon uses it unless said "
      "otherwise.");
  write_table(measure_findings(plan), report.document);
  if (!peers_available()) report.document.paragraph(peers_description());
}

}  // namespace isomesh::bench
