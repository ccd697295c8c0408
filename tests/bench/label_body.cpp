#include "tests/bench/label_body.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

namespace isomesh::bench {
namespace {

constexpr double kSpacing = 1.5;  // mm
constexpr std::size_t kTubes = 24;

using Point = std::array<double, 3>;

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
    std::rotate(at.begin(), at.begin() + static_cast<std::ptrdiff_t>(number % 3), at.end());
    paint(body, label, {at, {kRadius, kRadius, kRadius}});
  }
}

}  // namespace

std::array<double, 3> even_point(std::size_t n) {
  constexpr double kStep = 0.8191725133961645;  // the inverse of the root of x^4 = x + 1
  Point point;
  double step = 1;
  for (double& coordinate : point) {
    step *= kStep;
    coordinate = std::fmod(0.5 + step * static_cast<double>(n + 1), 1);
  }
  return point;
}

Samples label_body(std::uint32_t n) {
  Samples body;
  body.name = "body-" + std::to_string(n);
  body.source = std::to_string(n);
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

}  // namespace isomesh::bench
