// The parts of a surface that a job leaves out.
#include <algorithm>
#include <numeric>
#include <utility>

#include "client/verify/field.h"

namespace isomesh::verify {
namespace {

// The samples at the other ends of a sample's edges, as steps.
std::vector<Sample> edges_of(int tetrahedra, bool is_odd) {
  std::vector<Sample> steps;
  for (std::int64_t n = 0; n < 27; ++n) {
    const Sample step = {n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1};
    const auto [low, high] = std::ranges::minmax(step);
    const std::int64_t length = std::abs(step[0]) + std::abs(step[1]) + std::abs(step[2]);
    const bool is_edge = tetrahedra == 6 ? low * high >= 0 : length < (is_odd ? 2 : 3);
    if (is_edge && length > 0) steps.push_back(step);
  }
  return steps;
}

std::uint32_t component_near(const Vec& place, const Surface& surface,
                             const std::vector<std::uint32_t>& components) {
  const auto nearest = std::ranges::min_element(
      surface.points, {}, [&](const Vec& point) { return squared(point - place); });
  return components[static_cast<std::size_t>(nearest - surface.points.begin())];
}

}  // namespace

// Samples below the iso-value that no path along edges connects with the border of the volume.
void fill_cavities(const Cut& cut, Field& field) {
  const auto nx = field.dims[0];
  const auto ny = field.dims[1];
  const auto nz = field.dims[2];
  const auto number = [&](const Sample& s) {
    return static_cast<std::size_t>((s[2] * ny + s[1]) * nx + s[0]);
  };
  const auto is_within = [&](const Sample& s) {
    return s[0] >= 0 && s[0] < nx && s[1] >= 0 && s[1] < ny && s[2] >= 0 && s[2] < nz;
  };
  const std::array edges = {edges_of(cut.tetrahedra, false), edges_of(cut.tetrahedra, true)};
  std::vector<bool> is_open(field.values.size());
  std::vector<Sample> waiting;
  const auto reach = [&](const Sample& s) {
    if (!is_within(s) || is_open[number(s)] || field.values[number(s)] >= cut.iso) return;
    is_open[number(s)] = true;
    waiting.push_back(s);
  };
  for (Sample s = {0, 0, 0}; s[2] < nz; ++s[2]) {
    for (s[1] = 0; s[1] < ny; ++s[1]) {
      const bool is_face = s[2] == 0 || s[2] == nz - 1 || s[1] == 0 || s[1] == ny - 1;
      for (s[0] = 0; s[0] < nx; s[0] += is_face || nx == 1 ? 1 : nx - 1) reach(s);
    }
  }
  while (!waiting.empty()) {
    const Sample s = waiting.back();
    waiting.pop_back();
    for (const Sample& step : edges.at((s[0] + s[1] + s[2]) & 1)) {
      reach({s[0] + step[0], s[1] + step[1], s[2] + step[2]});
    }
  }
  for (std::size_t n = 0; n < is_open.size(); ++n) {
    if (!is_open[n]) field.values[n] = std::max(field.values[n], cut.iso);
  }
}

void keep_components(const ComponentFilter& filter, Surface& surface) {
  if (filter.keeps_all() || surface.points.empty()) return;
  const std::vector<std::uint32_t> components = components_of(surface);
  std::vector<std::uint64_t> sizes(components.size());
  for (const Indices& triangle : surface.triangles) ++sizes[components[triangle[0]]];
  std::vector<std::uint32_t> order(sizes.size());
  if (filter.nearest_to.empty()) {
    std::iota(order.begin(), order.end(), 0U);
  } else {
    order.clear();
    for (const Vec& place : filter.nearest_to) {
      order.push_back(component_near(place, surface, components));
    }
    std::ranges::sort(order);
    order.erase(std::unique(order.begin(), order.end()), order.end());
  }
  const std::uint64_t least = std::max(filter.min_triangles.value_or(1), 1U);
  std::erase_if(order, [&](std::uint32_t n) { return sizes[n] < least; });
  std::ranges::stable_sort(order, std::greater{}, [&](std::uint32_t n) { return sizes[n]; });
  if (filter.keep && order.size() > *filter.keep) order.resize(*filter.keep);
  std::vector<bool> stays(sizes.size());
  for (const std::uint32_t n : order) stays[n] = true;
  std::erase_if(surface.triangles, [&](const Indices& t) { return !stays[components[t[0]]]; });
}

}  // namespace isomesh::verify
