#include "server/import/dicom/geometry/even_line.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/import/dicom/geometry/vectors.h"

namespace isomesh::import::dicom {
namespace {

constexpr double kSame = 1e-6;  // mm

double rounding_of(std::span<const Vector3> places, std::size_t axis) {
  constexpr double kWhole = 1e-6;
  for (const double per_mm : {1.0, 10.0, 100.0}) {
    const auto is_multiple = [&](const Vector3& place) {
      const double count = place[axis] * per_mm;
      return std::abs(count - std::round(count)) <= kWhole;
    };
    if (std::ranges::all_of(places, is_multiple)) return 1 / per_mm;
  }
  return 0;
}

// The range of what is left of a coordinate without `slope` for each step.
std::pair<double, double> range_left(std::span<const Vector3> places, std::span<const double> steps,
                                     std::size_t axis, double slope) {
  double low = places[0][axis] - slope * steps[0];
  double high = low;
  for (std::size_t i = 1; i < places.size(); ++i) {
    const double left = places[i][axis] - slope * steps[i];
    low = std::min(low, left);
    high = std::max(high, left);
  }
  return {low, high};
}

// The range's width is a convex function of the slope, so halving finds its smallest value.
double best_slope(std::span<const Vector3> places, std::span<const double> steps,
                  std::size_t axis) {
  constexpr int kRounds = 100;
  double low = (places[1][axis] - places[0][axis]) / (steps[1] - steps[0]);
  double high = low;
  for (std::size_t i = 2; i < places.size(); ++i) {
    const double slope = (places[i][axis] - places[i - 1][axis]) / (steps[i] - steps[i - 1]);
    low = std::min(low, slope);
    high = std::max(high, slope);
  }
  const auto width = [&](double slope) {
    const auto [least, most] = range_left(places, steps, axis, slope);
    return most - least;
  };
  for (int round = 0; round < kRounds; ++round) {
    const double third = (high - low) / 3;
    if (width(low + third) <= width(high - third)) {
      high -= third;
    } else {
      low += third;
    }
  }
  return (low + high) / 2;
}

}  // namespace

bool EvenLine::explains_places() const {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (off[axis] > rounding[axis] / 2 + kSame) return false;
  }
  return true;
}

EvenLine nearest_line(std::span<const Vector3> places, std::span<const double> steps) {
  EvenLine line;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    line.step[axis] = best_slope(places, steps, axis);
    const auto [low, high] = range_left(places, steps, axis, line.step[axis]);
    line.origin[axis] = (low + high) / 2;
    line.off[axis] = (high - low) / 2;
    line.rounding[axis] = line.off[axis] > kSame ? rounding_of(places, axis) : 0;
  }
  for (std::size_t i = 0; i < places.size(); ++i) {
    const Vector3 place = moved(line.origin, line.step, steps[i]);
    line.farthest = std::max(line.farthest, length(difference(places[i], place)));
  }
  return line;
}

}  // namespace isomesh::import::dicom
