#include "server/mesh/collapse/tube.h"

#include <algorithm>
#include <numeric>

namespace isomesh::mesh::collapse {

void Tube::compact() {
  std::vector<std::uint32_t> number(vertices.size(), 0);
  for (const Triangle& triangle : triangles) {
    for (const std::uint32_t v : triangle) number[v] = 1;
  }
  std::vector<std::uint32_t> named;
  for (std::uint32_t v = 0; v < number.size(); ++v) {
    if (number[v] != 0) named.push_back(v);
  }
  std::ranges::sort(named, {}, [&](std::uint32_t v) { return origins[v]; });
  Tube tube;
  for (const std::uint32_t v : named) {
    number[v] = static_cast<std::uint32_t>(tube.vertices.size());
    tube.add(vertices[v], origins[v]);
    tube.border.back() = border[v];
    tube.planes.back() = planes[v];
  }
  tube.triangles = std::move(triangles);
  for (Triangle& triangle : tube.triangles) {
    for (std::uint32_t& v : triangle) v = number[v];
  }
  *this = std::move(tube);
}

}  // namespace isomesh::mesh::collapse
