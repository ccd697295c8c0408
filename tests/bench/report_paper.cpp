#include <algorithm>
#include <array>
#include <limits>
#include <optional>

#include "tests/bench/experiments.h"
#include "tests/bench/numbers.h"
#include "tests/bench/paper.h"
#include "tests/bench/peers.h"
#include "tests/bench/report_sections.h"
#include "tests/bench/report_text.h"
#include "tests/bench/timing.h"

namespace isomesh::bench {
namespace {

constexpr int kPasses = 5;
constexpr std::size_t kPaperSubTables = 250;
constexpr std::uint64_t kLargePaperMesh = 337'863;  // triangles
constexpr std::uint64_t kSmallPaperMesh = 71'795;
constexpr std::array kCubes = {32U, 64U, 128U};

using Rows = std::vector<std::vector<std::string>>;

// The paper's own surface of integer samples keeps its vertices off the samples when the iso-value
// is no integer. Which samples are inside does not change.
double off_the_samples(const Samples& samples, double iso) {
  return samples.type == SampleType::kFloat32 ? iso : iso - 0.5;
}

double paper_generation_ms(const Samples& samples, double iso, Scheme scheme, Soup& soup) {
  const Surface surface = {.iso = off_the_samples(samples, iso), .scheme = scheme};
  return time_ms({[&] { soup = extract_soup(samples, surface); }});
}

// Six against five.
struct SchemeFactors {
  double triangles = 0;
  double time = 0;
};

// One row for each scheme.
SchemeFactors compare_schemes(const Samples& samples, const Subject::Level& level, Rows& rows) {
  std::array<MeshSize, 2> sizes;
  std::array<double, 2> times = {0, 0};
  for (const Scheme scheme : {Scheme::kFive, Scheme::kSix}) {
    const std::size_t index = scheme == Scheme::kSix ? 1 : 0;
    Stages stages(samples, {.iso = level.iso, .scheme = scheme});
    stages.extract();  // to warm up
    constexpr int kRuns = 7;
    times[index] = median_ms({[&] { stages.extract(); }}, kRuns);
    sizes[index] = stages.size();
    Soup soup;
    const double paper_ms = paper_generation_ms(samples, level.iso, scheme, soup);
    const bool first = scheme == Scheme::kFive;
    const double peer_ms =
        first && peers_available() ? measure_flying_edges(samples, level.iso).extract_ms : 0;
    rows.push_back({title_of(samples, level), scheme_name(scheme),
                    grouped(sizes[index].triangles * 3), grouped(sizes[index].vertices),
                    milliseconds(times[index]), milliseconds(paper_ms),
                    first ? peer_time(peer_ms) : ""});
  }
  return {static_cast<double>(sizes[1].triangles) / static_cast<double>(sizes[0].triangles),
          times[1] / times[0]};
}

// The time with a number of sub-tables; 0 when it was not measured.
double time_with(const Series& series, std::size_t sub_tables) {
  for (const auto& [count, ms] : series.points) {
    if (count == static_cast<double>(sub_tables)) return ms;
  }
  return 0;
}

// Five passes with each number of sub-tables: a row each, and the best to the remarks.
Series time_sub_tables(const Soup& soup, Rows& rows, Report& report) {
  const std::string triangles = grouped(soup.size()) + " triangles";
  Series series = {"the paper's way, " + triangles, {}};
  double best_ms = std::numeric_limits<double>::infinity();
  std::size_t best = 0;
  for (const std::size_t count :
       {1U, 2U, 5U, 10U, 20U, 50U, 100U, 150U, 200U, 250U, 300U, 400U, 500U, 700U, 1000U}) {
    const auto figures = measure_paper_smoothing(soup, count, kPasses);
    if (!figures) continue;
    const double total_ms = figures->total_ms();
    series.points.push_back({static_cast<double>(count), total_ms});
    if (total_ms < best_ms) best = count;
    best_ms = std::min(best_ms, total_ms);
    rows.push_back({triangles, std::to_string(count), milliseconds(figures->unique_ms),
                    milliseconds(figures->neighbors_ms), milliseconds(figures->passes_ms),
                    milliseconds(total_ms)});
  }
  report.remarks.push_back("The paper finds 150 to 250 sub-tables best. For " + triangles +
                           " the best of those tried here is " + std::to_string(best) + " with " +
                           milliseconds(best_ms) + ", beside " +
                           milliseconds(time_with(series, kPaperSubTables)) + " with 250.");
  return series;
}

// isomesh and VTK on the same volume, which have no sub-tables.
std::vector<Series> level_lines(const Samples& samples, double iso) {
  constexpr int kRuns = 5;
  const auto line = [](const std::string& label, double ms) {
    return Series{label, {{1, ms}, {1000, ms}}};
  };
  Stages stages(samples, {.iso = iso});
  stages.extract();
  std::vector<Series> lines = {line("isomesh, " + grouped(stages.size().triangles) + " triangles",
                                    median_ms({[&] { stages.smooth(kPasses); }}, kRuns))};
  if (peers_available()) {
    Peers peers(samples, iso);
    peers.flying_edges();
    lines.push_back(line("VTK, " + grouped(peers.size().triangles) + " triangles",
                         median_ms({[&] { peers.smooth(kPasses); }}, kRuns)));
  }
  return lines;
}

}  // namespace

void write_table_2(const std::vector<Subject>& subjects, Report& report) {
  say("Table 2");
  report.document.heading("Five against six tetrahedra (the paper's Table 2)");
  report.document.paragraph(
      "*Vertices* counts three for every triangle, as the paper does. *The paper's way* is a loop "
      "over cells and tetrahedra that writes triangles with three vertices each, on one thread; in "
      "the paper's own rows it is the paper's time on a Pentium III of 600 MHz. Flying Edges makes "
      "marching cubes' triangles, a third as many.");
  Rows rows = {{"the paper, 128x128x128", "5 tetrahedra", "1 631 460", "", "", "970 ms", ""},
               {"the paper, 128x128x128", "6 tetrahedra", "2 027 184", "", "", "1.25 s", ""}};
  std::vector<std::string> lines;
  Factors of_triangles;
  Factors of_times;
  for (const Subject& subject : subjects) {
    for (const Subject::Level& level : subject.levels) {
      const SchemeFactors factors = compare_schemes(subject.samples, level, rows);
      of_triangles.include(factors.triangles);
      of_times.include(factors.time);
      lines.push_back(title_of(subject.samples, level) + ": six give " +
                      fixed(factors.triangles, 2) + " times the triangles of five in " +
                      fixed(factors.time, 2) + " times the time (the paper: 1.24 and 1.29).");
    }
  }
  report.document.table(
      {"volume", "scheme", "vertices", "unique", "isomesh", "the paper's way", "Flying Edges"},
      rows);
  report.document.bullets(lines);
  report.remarks.push_back(
      "The paper's conclusion prefers six tetrahedra for time and number of triangles. Its own "
      "Table 2 says the opposite; here six give " +
      of_triangles.text(2) + " times the triangles of five in " + of_times.text(2) +
      " times the time.");
}

void write_table_3(const Subject& head, Report& report) {
  say("Table 3");
  report.document.heading("Vertices and unique vertices (the paper's Table 3)");
  report.document.paragraph(
      "Six tetrahedra. A closed surface has two triangles for every vertex but a few, so the ratio "
      "tends to 1/6; a boundary raises it. *The paper's way* finds the unique vertices among three "
      "per triangle by 250 sorted sub-tables; isomesh numbers them while it extracts and never "
      "searches.");
  Rows rows = {{"the paper, 32x32x32", "44 880", "7 415", "0.17", "", "", ""},
               {"the paper, 64x64x64", "215 616", "35 888", "0.17", "", "", ""},
               {"the paper, 128x128x128", "1 013 592", "171 819", "0.17", "", "", ""}};
  for (const Subject::Level& level : head.levels) {
    for (const std::uint32_t n : kCubes) {
      const Samples cube = resample(head.samples, {n, n, n});
      Stages stages(cube, {.iso = level.iso});
      stages.extract();
      const MeshSize size = stages.size();
      std::size_t found = 0;
      const Soup soup = soup_of(stages.positions(), stages.triangles());
      const double search_ms =
          time_ms({[&] { found = find_unique(soup, kPaperSubTables).vertices.size(); }});
      std::string peer = "-";
      if (peers_available()) {
        const MeshSize edges = measure_flying_edges(cube, level.iso).size;
        peer = grouped(edges.triangles * 3) + " / " + grouped(edges.vertices);
      }
      const double ratio =
          static_cast<double>(size.vertices) / (3 * static_cast<double>(size.triangles));
      rows.push_back({title_of(cube, level), grouped(size.triangles * 3), grouped(size.vertices),
                      fixed(ratio, 3), grouped(found), milliseconds(search_ms), peer});
    }
  }
  report.document.table({"volume", "vertices", "unique", "ratio", "unique, the paper's way",
                         "its search", "Flying Edges, vertices / unique"},
                        rows);
  report.remarks.push_back(
      "The 2 027 184 vertices of the paper's Table 2 are exactly twice the 1 013 592 of its Table "
      "3 for a volume of the same size; it does not say which surface either is.");
}

void write_figure_4(const Subject& head, Report& report) {
  say("Figure 4");
  const Subject::Level& level = head.levels.front();
  report.document.heading("Time against the number of sub-tables (the paper's Figure 4)");
  report.document.paragraph(
      "The CT head, resampled to the cubes whose " + level.name +
      " come nearest to the paper's 337 863 and 71 795 triangles; time of finding the unique "
      "vertices, their neighbours and five passes, the paper's way, on one thread, one run each. "
      "Few sub-tables on the larger mesh would take minutes and are left out. The level lines are "
      "isomesh and vtkSmoothPolyDataFilter on the same volume, connectivity and five passes. The "
      "search for unique vertices gains little from many tables: vertices on lattice edges that "
      "run in a plane of samples share their x, whatever the table.");
  Plot plot = {.title = "Five passes, the paper's way",
               .x = {"sub-tables", Scale::kLog},
               .y = {"time, ms", Scale::kLog},
               .series = {},
               .band = Band{150, 250, "the paper's best"}};
  Rows rows;
  std::vector<Series> levels;
  for (const std::uint64_t target : {kLargePaperMesh, kSmallPaperMesh}) {
    const Samples cube = resample_for_triangles(head.samples, {.iso = level.iso}, target);
    Stages stages(cube, {.iso = level.iso});
    stages.extract();
    plot.series.push_back(
        time_sub_tables(soup_of(stages.positions(), stages.triangles()), rows, report));
    if (target == kLargePaperMesh) levels = level_lines(cube, level.iso);
  }
  plot.series.insert(plot.series.end(), levels.begin(), levels.end());
  report.document.plot("sub-tables", plot);
  report.document.table(
      {"mesh", "sub-tables", "unique vertices", "neighbours", "five passes", "all"}, rows);
}

void write_figures_5_and_6(const Subject& head, Report& report) {
  say("Figures 5 and 6");
  report.document.heading("Generation and smoothing (the paper's Figures 5 and 6)");
  report.document.paragraph(
      "The same two meshes, generation included. The paper's machine was a Pentium III of 600 MHz. "
      "VTK is Flying Edges and vtkSmoothPolyDataFilter, on its own smaller mesh.");
  struct Figure {
    std::uint64_t triangles;
    int passes;
    std::string paper;
  };
  const Subject::Level& level = head.levels.front();
  Rows rows;
  for (const Figure& figure :
       {Figure{kLargePaperMesh, 5, "37.6 s"}, Figure{kLargePaperMesh, 10, "39.85 s"},
        Figure{kSmallPaperMesh, 5, "4.58 s"}}) {
    const Samples cube = resample_for_triangles(head.samples, {.iso = level.iso}, figure.triangles);
    const PassesFigures ours =
        measure_passes(cube, level.iso, std::span(&figure.passes, 1)).front();
    Soup soup;
    const double generation_ms = paper_generation_ms(cube, level.iso, Scheme::kSix, soup);
    const auto smoothing = measure_paper_smoothing(soup, kPaperSubTables, figure.passes);
    rows.push_back(
        {grouped(figure.triangles) + " triangles, " + std::to_string(figure.passes) + " passes",
         figure.paper, grouped(soup.size()),
         smoothing ? milliseconds(generation_ms + smoothing->total_ms()) : "-",
         milliseconds(ours.ours_ms), peer_time(ours.peer_smooth_ms)});
  }
  report.document.table({"the paper's figure", "the paper", "triangles here",
                         "the paper's way, here", "isomesh", "VTK"},
                        rows);
}

}  // namespace isomesh::bench
