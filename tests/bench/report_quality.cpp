#include <array>
#include <numeric>

#include "tests/bench/experiments.h"
#include "tests/bench/numbers.h"
#include "tests/bench/peers.h"
#include "tests/bench/report_sections.h"
#include "tests/bench/report_text.h"

namespace isomesh::bench {
namespace {

using Rows = std::vector<std::vector<std::string>>;

// Bins of an aspect ratio's distribution that count as poor.
constexpr std::size_t kPoorBins = 6;
constexpr double kPoor = static_cast<double>(kPoorBins) / Distribution::kBins;

double poor_share(const Distribution& ratios) {
  const auto& bins = ratios.histogram;
  const auto sum = [](auto begin, auto end) {
    return static_cast<double>(std::accumulate(begin, end, std::uint64_t{0}));
  };
  return sum(bins.begin(), bins.begin() + kPoorBins) / sum(bins.begin(), bins.end());
}

// The four ways to extract.
std::vector<Surface> ways_to_extract(double iso) {
  std::vector<Surface> ways;
  for (const Scheme scheme : {Scheme::kFive, Scheme::kSix}) {
    for (const Interpolation way : {Interpolation::kLinear, Interpolation::kMidpoint}) {
      ways.push_back({iso, scheme, way, true});
    }
  }
  return ways;
}

std::string name_of(const Surface& surface) {
  return scheme_name(surface.scheme) + ", " + std::string(to_string(surface.interpolation));
}

// A figure of a smoothed surface, drawn against the number of passes.
struct Quantity {
  const char* file;
  const char* label;
  double (*of)(const SmoothedFigures&);
  int digits;
};

constexpr std::array kQuantities = {
    Quantity{"aspect-ratio", "mean aspect ratio",
             [](const SmoothedFigures& one) { return one.shapes.aspect_ratio.mean; }, 3},
    Quantity{"poor", "poor triangles, %",
             [](const SmoothedFigures& one) { return 100 * poor_share(one.shapes.aspect_ratio); },
             2},
    Quantity{"smallest-angle", "mean of the triangles' smallest angles, degrees",
             [](const SmoothedFigures& one) { return one.shapes.smallest_angle_deg.mean; }, 1},
    Quantity{"least-angle", "smallest angle of all, degrees",
             [](const SmoothedFigures& one) { return one.shapes.smallest_angle_deg.min; }, 3},
    Quantity{"volume", "change of the enclosed volume, %",
             [](const SmoothedFigures& one) { return 100 * (one.volume_kept - 1); }, 3},
};

struct Smoothed {
  std::string name;
  std::vector<SmoothedFigures> by_passes;
};

void write_quantity(const Quantity& quantity, const std::string& title, const std::string& volume,
                    const std::vector<Smoothed>& all, Document& document) {
  Plot plot = {.title = std::string(quantity.label) + ": " + title,
               .x = {"passes", Scale::kLinear},
               .y = {quantity.label, Scale::kLinear},
               .series = {}};
  std::vector<std::string> head = {quantity.label};
  for (const SmoothedFigures& one : all.front().by_passes) {
    head.push_back(std::to_string(one.passes));
  }
  Rows rows;
  for (const Smoothed& smoothed : all) {
    Series series = {smoothed.name, {}};
    rows.push_back({smoothed.name});
    for (const SmoothedFigures& one : smoothed.by_passes) {
      series.points.push_back({static_cast<double>(one.passes), quantity.of(one)});
      rows.back().push_back(fixed(quantity.of(one), quantity.digits));
    }
    plot.series.push_back(std::move(series));
  }
  document.plot(std::string(quantity.file) + "-" + volume, plot);
  document.table(head, rows);
}

}  // namespace

void write_choices(const std::vector<Subject>& subjects, Report& report) {
  report.document.heading("Five against six, linear against midpoint: what they do to the mesh");
  report.document.paragraph(
      "*Aspect ratio* is twice the inscribed circle's radius over the circumscribed one's: 1 for "
      "an "
      "equilateral triangle, 0 for one without area. *Poor* is the share of triangles below " +
      fixed(kPoor, 1) +
      ". Smoothing is five passes, lambda 1. *Volume* is the enclosed volume after smoothing as a "
      "share of that before; an open surface is closed by a cone. Draco is the `drc` file.");
  Factors poor_before;
  Factors poor_after;
  Factors volume;
  for (const Subject& subject : subjects) {
    const Subject::Level& level = subject.levels.front();
    say("choices, " + title_of(subject.samples, level));
    Rows rows;
    for (const Scheme scheme : {Scheme::kFive, Scheme::kSix}) {
      for (const Interpolation way : {Interpolation::kLinear, Interpolation::kMidpoint}) {
        const SurfaceFigures figures = measure_surface(subject.samples, {level.iso, scheme, way});
        const double bits = 8 * static_cast<double>(figures.drc_bytes) /
                            static_cast<double>(figures.size.triangles);
        const double kept = figures.smoothed_mm3 / figures.extracted_mm3;
        if (way == Interpolation::kLinear) {
          poor_before.include(100 * poor_share(figures.extracted));
          poor_after.include(100 * poor_share(figures.smoothed));
        }
        volume.include(100 * kept);
        rows.push_back(
            {scheme_name(scheme) + ", " + std::string(to_string(way)),
             grouped(figures.size.triangles), milliseconds(figures.extract_ms),
             milliseconds(figures.smooth_ms), mebibytes(figures.drc_bytes), fixed(bits, 1),
             fixed(figures.extracted.mean, 2) + " / " + fixed(figures.smoothed.mean, 2),
             percent(poor_share(figures.extracted)) + " / " + percent(poor_share(figures.smoothed)),
             percent(kept)});
      }
    }
    if (peers_available()) {
      const PeerFigures peer = measure_flying_edges(subject.samples, level.iso);
      rows.push_back({"Flying Edges", grouped(peer.size.triangles), milliseconds(peer.extract_ms),
                      "", "", "", "", "", ""});
    }
    report.document.paragraph("**" + title_of(subject.samples, level) + "**");
    report.document.table({"", "triangles", "extraction", "smoothing", "Draco", "bits per triangle",
                           "aspect ratio before / after", "poor before / after", "volume"},
                          rows);
  }
  report.remarks.push_back(
      "That smoothing repairs bad triangles holds: with linear interpolation " +
      poor_before.text(1) + " % are poor before and " + poor_after.text(1) +
      " % after five passes. Midpoint vertices leave hardly any to repair. What happens to the "
      "enclosed volume the paper does not ask: " +
      volume.text(1) + " % of it is there after smoothing.");
}

void write_quality(const std::vector<Subject>& subjects, Report& report) {
  constexpr std::array kPasses = {0, 1, 2, 5, 10, 20};
  report.document.heading("What smoothing does to the triangles, and to the volume");
  report.document.paragraph(
      "The paper says that smoothing makes triangles well shaped, and shows pictures. Here are the "
      "numbers, against passes of 0, 1, 2, 5, 10 and 20, with aspect ratio and poor triangles as "
      "above. Surfaces are closed where they meet the volume's border, so that what they enclose "
      "is "
      "exact. Laplacian has lambda 1; Taubin's passes are two steps each, with the daemon's "
      "defaults.");
  Factors laplacian;
  Factors taubin;
  for (const Subject& subject : subjects) {
    const Subject::Level& level = subject.levels.front();
    const std::string title = title_of(subject.samples, level);
    say("quality, " + title);
    std::vector<Smoothed> all;
    for (const Smoothing smoothing : {Smoothing::kLaplacian, Smoothing::kTaubin}) {
      for (const Surface& surface : ways_to_extract(level.iso)) {
        all.push_back({name_of(surface) + ", " + std::string(to_string(smoothing)),
                       measure_smoothed(subject.samples, surface, smoothing, kPasses)});
        const double lost = 100 * (1 - all.back().by_passes.back().volume_kept);
        (smoothing == Smoothing::kTaubin ? taubin : laplacian).include(lost);
      }
    }
    report.document.paragraph("**" + title + "**");
    for (const Quantity& quantity : kQuantities) {
      write_quantity(quantity, title, subject.samples.name, all, report.document);
    }
  }
  report.remarks.push_back(
      "What the paper's smoothing costs in volume it does not say: 20 passes take " +
      laplacian.text(3) + " % of what the surfaces enclose, and Taubin's " + taubin.text(3) +
      " %; a negative number is a gain.");
}

}  // namespace isomesh::bench
