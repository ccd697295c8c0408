#include "server/mesh/measure/distance.h"

#include <cmath>
#include <limits>
#include <vector>

#include "server/mesh/measure/marked_cubes.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

// Consecutive points are near each other, so each result is the guess for the next point. Each
// block starts without a guess and has a fixed size, so sums do not depend on the number of
// threads.
constexpr std::size_t kBlock = 2048;

// Neighbouring points make good guesses, so what is measured of many points are runs.
constexpr std::size_t kRun = 256;

constexpr double kPercentile = 0.99;

struct Sums {
  double sum = 0;
  double squares = 0;
  float max = 0;
};

// The points of a surface in order: its vertices, then the centres of its triangles. Of more than
// `most`, every n-th run.
class Points {
 public:
  explicit Points(const SurfaceView& surface, std::size_t most = kAllPoints) : surface_(surface) {
    const std::size_t all = surface.positions.size() + surface.triangles.size();
    size_ = all;
    if (all <= most) return;
    const std::size_t runs = all / kRun;
    const std::size_t most_runs = most / kRun;
    step_ = (runs + most_runs - 1) / most_runs;
    size_ = runs / step_ * kRun;
  }

  std::size_t size() const { return size_; }

  Point operator[](std::size_t measured) const {
    return measured_point(surface_, measured + measured / kRun * (step_ - 1) * kRun);
  }

 private:
  const SurfaceView surface_;
  std::size_t size_ = 0;
  std::size_t step_ = 1;  // every so many runs one is measured
};

void throw_if_not_finite(const Point& point) {
  if (!std::isfinite(point[0]) || !std::isfinite(point[1]) || !std::isfinite(point[2])) {
    throw Error(ErrorCode::kUnusableVolume, "a position of the mesh is not a finite number");
  }
}

float distance_of(const Point& point, const TriangleGrid& to, std::uint32_t& guess) {
  throw_if_not_finite(point);
  const TriangleGrid::Nearest nearest = to.nearest(point, guess);
  guess = nearest.triangle;
  return static_cast<float>(std::sqrt(nearest.squared_mm));
}

// The distances of the first `count` points, and the sums of each block.
std::vector<Sums> measure(const Points& points, std::size_t count, const TriangleGrid& to,
                          const Context& context, Buffer<float>& distances) {
  distances.resize_for_overwrite(count);
  std::vector<Sums> blocks(chunks_of(count, kBlock));
  const auto measure_block = [&](std::size_t begin, std::size_t end) {
    Sums& sums = blocks[begin / kBlock];
    std::uint32_t guess = TriangleGrid::kNone;
    for (std::size_t n = begin; n < end; ++n) {
      const float distance = distance_of(points[n], to, guess);
      distances[n] = distance;
      sums.sum += distance;
      sums.squares += double{distance} * distance;
      sums.max = std::max(sums.max, distance);
    }
  };
  for_chunks(context, count, measure_block, kBlock);
  return blocks;
}

using Histogram = std::array<std::uint64_t, DistanceSummary::kBins>;

Histogram histogram_of(std::span<const float> distances, double max) {
  Histogram histogram = {};
  if (!std::isfinite(max)) return histogram;
  const double bins_per_mm = max > 0 ? DistanceSummary::kBins / max : 0;
  for (const float distance : distances) {
    const auto bin = static_cast<std::size_t>(distance * bins_per_mm);
    ++histogram[std::min(bin, DistanceSummary::kBins - 1)];
  }
  return histogram;
}

// The same as measure_distance, whatever `reach_mm` is.
DistanceSummary measure_within(const SurfaceView& from, const SurfaceView& to, double reach_mm,
                               const Context& context, std::size_t most) {
  constexpr std::size_t kFew = 4;  // one point in so many, or fewer
  const Points points(from, most);
  const std::size_t all = from.positions.size() + from.triangles.size();
  if (std::isfinite(reach_mm) && points.size() < all / kFew) {
    std::vector<Box> places;
    places.reserve(points.size());
    for (std::size_t n = 0; n < points.size(); ++n) {
      const Point point = points[n];
      throw_if_not_finite(point);
      places.push_back({point, point});
    }
    const MarkedCubes cubes(places, reach_mm);
    std::vector<Triangle> near;
    for (const Triangle& triangle : to.triangles) {
      if (cubes.are_near(box_of(to, triangle))) near.push_back(triangle);
    }
    const DistanceSummary found =
        measure_distance(from, TriangleGrid({to.positions, near}, context), context, most);
    if (found.max_mm <= reach_mm) return found;
  }
  return measure_distance(from, TriangleGrid(to, context), context, most);
}

}  // namespace

void measure_vertex_distances(const SurfaceView& from, const TriangleGrid& to,
                              const Context& context, Buffer<float>& distances) {
  measure(Points(from), from.positions.size(), to, context, distances);
}

DistanceSummary measure_distance(const SurfaceView& from, const TriangleGrid& to,
                                 const Context& context, std::size_t most) {
  const Points points(from, most);
  DistanceSummary summary;
  summary.points = points.size();
  if (summary.points == 0) return summary;
  Buffer<float> distances;
  Sums whole;
  for (const Sums& sums : measure(points, points.size(), to, context, distances)) {
    whole.sum += sums.sum;
    whole.squares += sums.squares;
    whole.max = std::max(whole.max, sums.max);
  }
  const auto count = static_cast<double>(summary.points);
  summary.max_mm = whole.max;
  summary.mean_mm = whole.sum / count;
  summary.rms_mm = std::sqrt(whole.squares / count);
  summary.histogram = histogram_of(distances.span(), summary.max_mm);
  const auto rank = static_cast<std::ptrdiff_t>(std::ceil(kPercentile * count)) - 1;
  std::nth_element(distances.begin(), distances.begin() + rank, distances.end());
  summary.p99_mm = distances[static_cast<std::size_t>(rank)];
  return summary;
}

Certificate certify(const SurfaceView& mesh, const SurfaceView& reference, const Context& context,
                    std::size_t most, double reach_mm) {
  return {.from_mesh = measure_within(mesh, reference, reach_mm, context.part(0, 0.5), most),
          .from_reference = measure_within(reference, mesh, reach_mm, context.part(0.5, 1), most)};
}

}  // namespace isomesh::mesh
