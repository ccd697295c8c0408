#include "server/mesh/collapse/simplify_layers.h"

#include <algorithm>
#include <cstdint>
#include <numeric>

namespace isomesh::mesh {
namespace {

constexpr std::uint32_t kUnnamed = ~std::uint32_t{0};

void take_flags(std::vector<std::uint64_t>& flags, const std::vector<std::uint32_t>& numbers,
                std::size_t count) {
  if (flags.empty()) return;
  std::vector<std::uint64_t> taken((count + kFlagBits - 1) / kFlagBits, 0);
  for (std::size_t v = 0; v < numbers.size(); ++v) {
    if (numbers[v] == kUnnamed || (flags[v / kFlagBits] >> (v % kFlagBits) & 1) == 0) continue;
    taken[numbers[v] / kFlagBits] |= std::uint64_t{1} << (numbers[v] % kFlagBits);
  }
  flags = std::move(taken);
}

// Begins of the layers, as numbers of vertices: behind each begin the next one comes as soon as no
// triangle that begins before the one reaches beyond the other.
std::vector<std::uint64_t> cut_layers(std::span<const std::uint64_t> layers,
                                      std::span<const Triangle> triangles, std::size_t vertices) {
  // The highest vertex of the triangles whose lowest one is below a layer's end.
  std::vector<std::uint64_t> reach(layers.size(), 0);
  for (const Triangle& triangle : triangles) {
    const auto [low, high] = std::ranges::minmax(triangle);
    const auto layer = std::ranges::upper_bound(layers, low) - layers.begin();
    std::uint64_t& end = reach[static_cast<std::size_t>(layer)];
    end = std::max<std::uint64_t>(end, high + 1);
  }
  std::partial_sum(reach.begin(), reach.end(), reach.begin(),
                   [](std::uint64_t a, std::uint64_t b) { return std::max(a, b); });
  std::vector<std::uint64_t> begins = {0};
  std::uint64_t needed = 0;
  for (std::size_t layer = 1; layer + 1 < layers.size(); ++layer) {
    if (layers[layer] < needed || layers[layer] == begins.back()) continue;
    begins.push_back(layers[layer]);
    needed = reach[layer];
  }
  if (begins.back() != vertices || begins.size() == 1) begins.push_back(vertices);
  return begins;
}

// Sorts the triangles and their sides by lowest vertex; the sort is stable. Returns for each vertex
// the number of triangles whose lowest vertex is smaller.
std::vector<std::uint64_t> order(std::vector<Triangle>& triangles, std::vector<WallSides>& sides,
                                 std::size_t vertices) {
  std::vector<std::uint64_t> begins(vertices + 2, 0);
  for (const Triangle& triangle : triangles) ++begins[std::ranges::min(triangle) + 2];
  std::partial_sum(begins.begin(), begins.end(), begins.begin());
  std::vector<Triangle> ordered(triangles.size());
  std::vector<WallSides> ordered_sides(sides.size());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const std::uint64_t to = begins[std::ranges::min(triangles[t]) + 1]++;
    ordered[to] = triangles[t];
    if (!sides.empty()) ordered_sides[to] = sides[t];
  }
  triangles = std::move(ordered);
  sides = std::move(ordered_sides);
  begins.pop_back();
  return begins;
}

}  // namespace

void replace_triangles(std::vector<Triangle>& triangles, std::vector<WallSides>& sides,
                       Mesh& mesh) {
  std::vector<std::uint32_t> numbers(mesh.positions.size(), kUnnamed);
  for (const Triangle& triangle : triangles) {
    for (const std::uint32_t vertex : triangle) numbers[vertex] = 0;
  }
  std::uint32_t count = 0;
  std::vector<std::uint64_t> layers;
  for (std::size_t v = 0, layer = 0; v <= numbers.size(); ++v) {
    for (; layer < mesh.layer_vertices.size() && mesh.layer_vertices[layer] == v; ++layer) {
      layers.push_back(count);
    }
    if (v == numbers.size() || numbers[v] == kUnnamed) continue;
    mesh.positions[count] = mesh.positions[v];
    if (!mesh.normals.empty()) mesh.normals[count] = mesh.normals[v];
    numbers[v] = count++;
  }
  mesh.positions.shrink(count);
  mesh.kept.clear();
  if (!mesh.normals.empty()) mesh.normals.resize(count);
  take_flags(mesh.on_border, numbers, count);
  take_flags(mesh.on_line, numbers, count);
  for (Triangle& triangle : triangles) {
    for (std::uint32_t& vertex : triangle) vertex = numbers[vertex];
  }
  const std::vector<std::uint64_t> begins = order(triangles, sides, count);
  mesh.layer_vertices = cut_layers(layers, triangles, count);
  mesh.layer_triangles.clear();
  for (const std::uint64_t vertex : mesh.layer_vertices) {
    mesh.layer_triangles.push_back(begins[vertex]);
  }
  mesh.triangles.shrink(triangles.size());
  std::ranges::copy(triangles, mesh.triangles.begin());
}

}  // namespace isomesh::mesh
