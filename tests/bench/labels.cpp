#include "tests/bench/labels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "server/mesh/label_surface.h"
#include "server/mesh/labels.h"
#include "server/mesh/separate.h"
#include "server/mesh/smooth.h"
#include "tests/bench/numbers.h"
#include "tests/bench/peers.h"
#include "tests/bench/stages.h"
#include "tests/bench/timing.h"

namespace isomesh::bench {
namespace {

constexpr Goal kPerLabelGoal = {0.1};
constexpr int kLabelPairs = 3;
constexpr int kLabelPasses = 10;
constexpr double kSpacing = 1.5;  // mm
constexpr std::size_t kTubes = 24;

using Point = std::array<double, 3>;

// Points that fill the unit cube evenly (M. Roberts, "The unreasonable effectiveness of quasirandom
// sequences", 2018).
Point even_point(std::size_t n) {
  constexpr double kStep = 0.8191725133961645;  // the inverse of the root of x^4 = x + 1
  Point point;
  double step = 1;
  for (double& coordinate : point) {
    step *= kStep;
    coordinate = std::fmod(0.5 + step * static_cast<double>(n + 1), 1);
  }
  return point;
}

// The body's space is the unit cube.
struct Ellipsoid {
  Point centre;
  Point radii;

  bool contains(const Point& p) const {
    double sum = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double share = (p[axis] - centre[axis]) / radii[axis];
      sum += share * share;
    }
    return sum <= 1;
  }
};

// Paints what the shape contains of its box.
void paint(Samples& body, std::uint8_t label, const Ellipsoid& shape) {
  const auto n = static_cast<double>(body.dims.x);
  std::array<std::size_t, 3> low;
  std::array<std::size_t, 3> high;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    low[axis] =
        static_cast<std::size_t>(std::max(0.0, (shape.centre[axis] - shape.radii[axis]) * n));
    high[axis] = static_cast<std::size_t>(
        std::min(n, std::ceil((shape.centre[axis] + shape.radii[axis]) * n) + 1));
  }
  for (std::size_t z = low[2]; z < high[2]; ++z) {
    for (std::size_t y = low[1]; y < high[1]; ++y) {
      for (std::size_t x = low[0]; x < high[0]; ++x) {
        const Point at = {static_cast<double>(x) / n, static_cast<double>(y) / n,
                          static_cast<double>(z) / n};
        if (shape.contains(at)) {
          body.bytes[(z * body.dims.y + y) * body.dims.x + x] = std::byte{label};
        }
      }
    }
  }
}

// A tube through the body: balls along a wave.
void paint_tube(Samples& body, std::uint8_t label, std::size_t number) {
  constexpr double kRadius = 0.02;
  constexpr int kBalls = 120;
  const Point from = even_point(number);
  for (int ball = 0; ball < kBalls; ++ball) {
    const double share = static_cast<double>(ball) / kBalls;
    const double wave = 0.06 * std::sin(4 * std::numbers::pi * share + static_cast<double>(number));
    Point at = {0.1 + 0.8 * from[0] + wave, 0.1 + 0.8 * from[1] - wave, 0.1 + 0.8 * share};
    std::ranges::rotate(at, at.begin() + static_cast<std::ptrdiff_t>(number % 3));
    paint(body, label, {at, {kRadius, kRadius, kRadius}});
  }
}

// Our way through all labels, in memory that is kept.
class LabelStages {
 public:
  explicit LabelStages(const Samples& body)
      : lattice_{body.as<std::uint8_t>(), body.dims, mesh::lattice_to_space(body.geometry)} {
    options_.labels = mesh::select_labels(mesh::count_labels(lattice_, {}), 0);
  }

  void count_voxels() const { mesh::count_labels(lattice_, {}); }
  void extract() {
    mesh::extract_walls(lattice_, options_, mesh::count_walls(lattice_, options_, {}), {},
                        surface_);
  }
  void smooth() {
    mesh::smooth({.passes = kLabelPasses, .max_displacement_mm = kSpacing / 2}, {}, surface_.mesh);
  }
  void measure() const { mesh::measure_labels(surface_, mesh::LabelTriangles(surface_), {}); }

  const std::vector<std::int64_t>& labels() const { return options_.labels; }
  MeshSize size() const { return {surface_.mesh.positions.size(), surface_.mesh.triangles.size()}; }

 private:
  mesh::Lattice<std::uint8_t> lattice_;
  mesh::SeparateOptions options_;
  mesh::SeparatingSurface surface_;
};

}  // namespace

Samples label_body(std::uint32_t n) {
  Samples body;
  body.name = "body-" + std::to_string(n);
  body.dims = {n, n, n};
  body.geometry.spacing = {kSpacing, kSpacing, kSpacing};
  body.bytes.resize(body.dims.samples());
  std::uint8_t label = 0;
  for (std::size_t e = 0; e < kBodyLabels - kTubes; ++e) {
    const Point place = even_point(e);
    const Point shape = even_point(e + kBodyLabels);
    Ellipsoid ellipsoid;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      ellipsoid.centre[axis] = 0.15 + 0.7 * place[axis];
      ellipsoid.radii[axis] = 0.05 + 0.06 * shape[axis];
    }
    paint(body, ++label, ellipsoid);
  }
  for (std::size_t tube = 0; tube < kTubes; ++tube) paint_tube(body, ++label, tube);
  return body;
}

std::vector<Finding> measure_label_findings(std::uint32_t n, int threads) {
  set_threads(threads);
  Peers::set_threads(threads);
  const Samples body = label_body(n);
  LabelStages stages(body);
  stages.extract();
  const std::string which = std::to_string(stages.labels().size()) + " labels, " + body.name;
  std::vector<Finding> findings;
  const auto add_alone = [&](const std::string& name, const std::string& what, const Timed& ours) {
    const double ms = median_ms(ours, kLabelPairs);
    findings.push_back({"labels/" + name, what + ", ms, " + which, milliseconds(ms), "", ms, {}});
  };
  const Timed extract = {[&] { stages.extract(); }};
  const Timed both = {[&] {
    stages.extract();
    stages.smooth();
  }};
  if (peers_available()) {
    Peers peers(body, 0);
    const Timed theirs = {[&] { peers.discrete_flying_edges(stages.labels()); },
                          [&] { peers.release(); }};
    const auto add = [&](const std::string& name, const std::string& what, const Timed& ours,
                         std::optional<Goal> goal) {
      const Paired times = time_in_pairs(ours, theirs, kLabelPairs);
      findings.push_back({"labels/" + name, what + " / discrete Flying Edges a label, " + which,
                          milliseconds(times.ours_ms), milliseconds(times.peer_ms), times.ratio,
                          goal});
    };
    add("extract", "extraction of all", extract, kPerLabelGoal);
    add("extract_smooth", "the same and 10 passes of smoothing", both, {});  // theirs is not smooth
  } else {
    add_alone("extract", "extraction of all", extract);
    add_alone("extract_smooth", "the same and 10 passes of smoothing", both);
  }
  add_alone("count_voxels", "voxels and bounds of each", {[&] { stages.count_voxels(); }});
  add_alone("measure", "topology, area and volume of each", {[&] { stages.measure(); }});
  findings.push_back({"labels/triangles",
                      "triangles, " + which,
                      grouped(stages.size().triangles),
                      "",
                      static_cast<double>(stages.size().triangles),
                      {}});
  return findings;
}

}  // namespace isomesh::bench
