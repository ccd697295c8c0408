#include "server/mesh/stairs/filter.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace isomesh::mesh {
namespace {

template <class Function>
std::vector<float> series_of(int degree, Function function) {
  constexpr int kPoints = 400;  // of the quadrature, which is exact up to twice that degree
  std::vector<double> series;
  double sum = 0;
  for (int j = 0; j <= degree; ++j) {
    double coefficient = 0;
    for (int i = 0; i < kPoints; ++i) {
      const double angle = std::numbers::pi * (i + 0.5) / kPoints;
      coefficient += function(1 - std::cos(angle)) * std::cos(j * angle);
    }
    series.push_back(coefficient * (j == 0 ? 1 : 2) / kPoints);
    sum += series.back();
  }
  std::vector<float> result;
  for (const double coefficient : series) result.push_back(static_cast<float>(coefficient / sum));
  return result;
}

}  // namespace

std::vector<float> diffusion_series(int degree, double time) {
  return series_of(degree, [&](double k) { return std::exp(-time * k); });
}

std::vector<float> flat_series(int degree, double time) {
  return series_of(degree, [&](double k) { return (1 + time * k) * std::exp(-time * k); });
}

void filter(const std::vector<std::uint32_t>& vertices, const std::vector<float>& shares,
            std::span<const float> series, const Context& context, WallShape& shape) {
  Buffer<Lanes> first;
  Buffer<Lanes> before;                          // T[j - 2], then T[j]
  Buffer<Lanes> now;                             // T[j - 1]
  first.resize_for_overwrite(shape.vertices());  // only of those that move
  for (Buffer<Lanes>* const each : {&before, &now}) {
    each->resize_for_overwrite(shape.vertices());
    for_chunks(context, shape.vertices(), [&](std::size_t begin, std::size_t end) {
      std::copy(shape.at.begin() + begin, shape.at.begin() + end, each->begin() + begin);
    });
  }
  for (std::size_t j = 1; j < series.size(); ++j) {
    for_each(context, vertices.size(), [&](std::size_t i) {
      const std::size_t v = vertices[i];
      const Lanes step = shape.kept(v, shares[v] * (shape.mean(v, now) - now[v]));
      const Lanes moved = now[v] + step;
      if (j == 1) first[v] = now[v];
      before[v] = j == 1 ? moved : 2.0F * moved - before[v];
      shape.at[v] += series[j] * (before[v] - first[v]);  // the sum of all is 1
    });
    std::swap(before, now);
  }
}

}  // namespace isomesh::mesh
