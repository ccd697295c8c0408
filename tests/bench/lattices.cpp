#include "tests/bench/lattices.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <numbers>
#include <string>
#include <vector>

#include "server/mesh/measure/distance.h"
#include "tests/bench/stages.h"
#include "tests/bench/timing.h"

namespace isomesh::bench {
namespace {

constexpr int kRuns = 3;
constexpr double kSmallDeg = 20;

struct Way {
  Smoothing smoothing = Smoothing::kLaplacian;
  int passes = 0;  // 0: the surface as it is extracted
};

constexpr std::array kWays = {Way{}, Way{Smoothing::kLaplacian, 10}, Way{Smoothing::kTaubin, 10},
                              Way{Smoothing::kAngle, 5}, Way{Smoothing::kOptimize, 5}};

// In degrees. 0 if the triangle has no area.
double smallest_angle(const mesh::Vec3& a, const mesh::Vec3& b, const mesh::Vec3& c) {
  const auto angle_at = [](const mesh::Vec3& at, const mesh::Vec3& one, const mesh::Vec3& other) {
    std::array<double, 3> u = {};
    std::array<double, 3> v = {};
    for (std::size_t i = 0; i < 3; ++i) {
      u[i] = double{one[i]} - at[i];
      v[i] = double{other[i]} - at[i];
    }
    const std::array normal = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                               u[0] * v[1] - u[1] * v[0]};
    return std::atan2(std::hypot(normal[0], normal[1], normal[2]),
                      u[0] * v[0] + u[1] * v[1] + u[2] * v[2]);
  };
  return std::min({angle_at(a, b, c), angle_at(b, c, a), angle_at(c, a, b)}) * 180 /
         std::numbers::pi;
}

double percent(double share) { return 100 * share; }

// Adds what all triangles' smallest angles are.
void add_angles(const Stages& stages, Json& row) {
  std::vector<double> angles;
  angles.reserve(stages.triangles().size());
  double sum = 0;
  for (const auto& [a, b, c] : stages.triangles()) {
    const auto positions = stages.positions();
    angles.push_back(smallest_angle(positions[a], positions[b], positions[c]));
    sum += angles.back();
  }
  if (angles.empty()) return;
  const auto count = static_cast<double>(angles.size());
  const auto percentile = angles.begin() + static_cast<std::ptrdiff_t>(angles.size() / 100);
  std::ranges::nth_element(angles, percentile);
  row["mean_angle_deg"] = sum / count;
  row["1_%_below_deg"] = *percentile;
  row["least_angle_deg"] = *std::min_element(angles.begin(), percentile + 1);
  const auto small = std::ranges::count_if(angles, [](double a) { return a < kSmallDeg; });
  row["below_20_deg_%"] = percent(static_cast<double>(small) / count);
}

// `extracted`: the surface before smoothing.
Json row_of(const Way& way, double step_mm, const mesh::TriangleGrid& extracted, Stages& stages) {
  stages.extract();
  const double before_mm3 = stages.volume_mm3();
  std::string smoothing = "none";
  if (way.passes > 0) {
    smoothing = std::string(to_string(way.smoothing)) + ", " + std::to_string(way.passes);
  }
  Json row = {{"smoothing", smoothing}, {"triangles", stages.size().triangles}};
  const Timed extract = {[&] { stages.extract(); }};
  const Timed smooth = {[&] { stages.smooth(way.passes, way.smoothing); }, extract.run};
  row["ms"] = median_ms(way.passes == 0 ? extract : smooth, kRuns);
  row["distance_steps"] = mesh::measure_distance(stages.mesh(), extracted, {}).max_mm / step_mm;
  row["volume_%"] = percent(stages.volume_mm3() / before_mm3 - 1);
  add_angles(stages, row);
  return row;
}

}  // namespace

Samples ball() {
  constexpr std::uint32_t kSize = 64;
  constexpr double kRadius = 27;
  // Off the samples, so that no symmetry flatters a lattice.
  constexpr std::array kCentre = {31.7, 31.4, 31.6};
  Samples samples = {.name = "ball",
                     .source = {},
                     .type = SampleType::kFloat32,
                     .dims = {kSize, kSize, kSize},
                     .geometry = {},
                     .bytes = std::vector<std::byte>(sizeof(float) * kSize * kSize * kSize)};
  std::byte* out = samples.bytes.data();
  for (std::uint32_t z = 0; z < kSize; ++z) {
    for (std::uint32_t y = 0; y < kSize; ++y) {
      for (std::uint32_t x = 0; x < kSize; ++x, out += sizeof(float)) {
        const auto value = static_cast<float>(
            kRadius - std::hypot(x - kCentre[0], y - kCentre[1], z - kCentre[2]));
        std::memcpy(out, &value, sizeof value);
      }
    }
  }
  return samples;
}

Json measure_lattices(const Samples& samples, double iso) {
  const double step_mm = std::ranges::min(samples.geometry.spacing);
  Json rows = Json::array();
  for (const Scheme scheme : {Scheme::kSix, Scheme::kFive, Scheme::kBcc}) {
    for (const bool regularize : {false, true}) {
      const Surface surface = {
          .iso = iso, .scheme = scheme, .close = true, .regularize = regularize};
      Stages reference(samples, surface);
      reference.extract();
      const mesh::TriangleGrid extracted(reference.mesh(), {});
      Stages stages(samples, surface);
      for (const Way& way : kWays) {
        Json row = {
            {"volume", samples.name}, {"scheme", name_of(scheme)}, {"regularised", regularize}};
        row.update(row_of(way, step_mm, extracted, stages));
        rows.push_back(row);
      }
    }
  }
  return rows;
}

}  // namespace isomesh::bench
