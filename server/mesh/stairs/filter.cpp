#include "server/mesh/stairs/filter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "server/mesh/stairs/waves.h"

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
  first.resize_for_overwrite(shape.vertices());  // only of those that move
  std::array<Buffer<Lanes>, 2> values;           // T[j], by whether j is odd
  for (Buffer<Lanes>& each : values) {
    each.resize_for_overwrite(shape.vertices());
    for_chunks(context, shape.vertices(), [&](std::size_t begin, std::size_t end) {
      std::copy(shape.at.begin() + begin, shape.at.begin() + end, each.begin() + begin);
    });
  }
  std::vector<std::size_t> bounds;
  for (const std::size_t block : shape.blocks()) {
    bounds.push_back(std::ranges::lower_bound(vertices, block) - vertices.begin());
  }
  in_waves(
      context, bounds, series.size() - 1, [&](std::size_t j, std::size_t begin, std::size_t end) {
        const Buffer<Lanes>& now = values[(j - 1) % 2];
        Buffer<Lanes>& next = values[j % 2];
        for (std::size_t i = begin; i < end; ++i) {
          const std::size_t v = vertices[i];
          const Lanes moved = now[v] + shape.kept(v, shares[v] * (shape.mean(v, now) - now[v]));
          if (j == 1) first[v] = now[v];
          next[v] = j == 1 ? moved : 2.0F * moved - next[v];
          shape.at[v] += series[j] * (next[v] - first[v]);  // the sum of all is 1
        }
      });
}

}  // namespace isomesh::mesh
