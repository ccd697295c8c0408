#include "tests/support/stars.h"

#include <algorithm>
#include <iterator>
#include <tuple>

namespace isomesh::test {

bool is_before(const Sample& a, const Sample& b) {
  return std::tuple(a[2], a[1], a[0]) < std::tuple(b[2], b[1], b[0]);
}

void add_to_stars(std::span<const Sample, 4> corners, Stars& stars) {
  for (const Sample& centre : corners) {
    for (const Sample& a : corners) {
      for (const Sample& b : corners) {
        if (a != centre && b != centre && a != b) stars[centre][a].insert(b);
      }
    }
  }
}

const Stars& stars_of(const mesh::Dims& dims, Scheme scheme, std::uint32_t margin) {
  static std::map<std::tuple<std::uint32_t, std::uint32_t, std::uint32_t, Scheme, std::uint32_t>,
                  Stars>
      known;
  const auto [place, is_new] = known.try_emplace({dims.x, dims.y, dims.z, scheme, margin});
  Stars& stars = place->second;
  if (!is_new) return stars;
  for_each_tetrahedron(dims, scheme, margin,
                       [&](const Tetrahedron& corners) { add_to_stars(corners.samples, stars); });
  return stars;
}

namespace {

// Those of `all` that can be reached from `first` through `all`.
Samples reached(const Star& star, const Samples& all, const Sample& first) {
  Samples found = {first};
  std::vector<Sample> open = {first};
  while (!open.empty()) {
    const Sample sample = open.back();
    open.pop_back();
    for (const Sample& next : star.at(sample)) {
      if (all.contains(next) && found.insert(next).second) open.push_back(next);
    }
  }
  return found;
}

}  // namespace

bool is_connected(const Star& star, const Samples& all) {
  return reached(star, all, *all.begin()).size() == all.size();
}

std::vector<Samples> components_of(const Star& star, Samples all) {
  std::vector<Samples> components;
  while (!all.empty()) {
    components.push_back(reached(star, all, *all.begin()));
    for (const Sample& sample : components.back()) all.erase(sample);
  }
  return components;
}

Samples common(const Samples& a, const Samples& b) {
  Samples both;
  std::ranges::set_intersection(a, b, std::inserter(both, both.end()));
  return both;
}

bool leaves_connected(const Star& star, const Samples& some) {
  Samples rest;
  for (const auto& [neighbour, ring] : star) {
    if (!some.contains(neighbour)) rest.insert(neighbour);
  }
  return !rest.empty() && is_connected(star, rest);
}

bool is_run(const Star& star, const Samples& ring, const Samples& some) {
  return some.empty() || (is_connected(star, some) && some.size() + 2 <= ring.size());
}

}  // namespace isomesh::test
