#include <algorithm>
#include <array>
#include <map>
#include <string>
#include <utility>

#include "tests/bench/accuracy.h"
#include "tests/bench/numbers.h"
#include "tests/bench/peers.h"
#include "tests/bench/report_sections.h"
#include "tests/bench/report_text.h"

namespace isomesh::bench {
namespace {

// Each way's points: triangles, and how far the scan's surface is from them.
std::vector<Series> by_triangles(const std::vector<Approximation>& rows) {
  std::map<std::string, Series> peers;
  Series ours = {"isomesh", {}};
  for (const Approximation& row : rows) {
    if (row.from_scan.points == 0) continue;
    const std::array<double, 2> point = {static_cast<double>(row.triangles), row.from_scan.max_mm};
    if (row.error_mm > 0) {
      ours.points.push_back(point);
    } else if (row.is_peer) {
      Series& series = peers[row.name];
      series.label = row.name;
      series.points.push_back(point);
    }
  }
  std::vector<Series> all = {std::move(ours)};
  for (auto& [name, series] : peers) all.push_back(std::move(series));
  for (Series& series : all) std::ranges::sort(series.points);
  return all;
}

}  // namespace

void write_accuracy(const std::vector<AccuracySubject>& subjects, Report& report) {
  report.document.heading("One number for the error");
  report.document.paragraph(
      "`isomesh-bench simplify`: a job to drc of five passes without a bound, the same with a "
      "certificate, and with `max_error_mm` E. *Scan* is the surface as it was extracted, before "
      "smoothing; *max to scan* is the largest distance of a vertex or a centre of a triangle of "
      "the file, as libdraco decodes it, from that surface, *from scan* the other way. The peers "
      "have the smoothed surface in memory and make as many triangles of it as E left; they know "
      "no "
      "bound. Each was run once.");
  if (!peers_available()) report.document.paragraph(peers_description());
  for (const AccuracySubject& subject : subjects) {
    say("accuracy, " + subject.samples.name);
    AccuracyPlan plan;
    plan.iso = subject.level.iso;
    plan.threads = report.threads;
    const std::vector<Approximation> rows = measure_approximations(subject.samples, plan);
    const std::string title = title_of(subject.samples, subject.level);
    report.document.paragraph("**" + title + "**");
    std::vector<std::vector<std::string>> cells;
    for (const Approximation& row : rows) cells.push_back(accuracy_row(row));
    report.document.table(accuracy_head(), cells);
    report.document.plot("error-" + subject.samples.name,
                         {.title = "Largest distance of the scan from the mesh: " + title,
                          .x = {"triangles", Scale::kLog},
                          .y = {"mm", Scale::kLog},
                          .series = by_triangles(rows)});
  }
}

}  // namespace isomesh::bench
