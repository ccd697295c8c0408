#include "server/mesh/measure/normals.h"

#include <algorithm>
#include <cmath>

#include "server/mesh/parallel.h"
#include "server/mesh/points.h"

namespace isomesh::mesh {
namespace {

// Each run looks at the triangles of one more layer.
constexpr std::size_t kLayersPerSlab = 16;

// Writes the normals of these layers' vertices, which only triangles of the same layers and of the
// one below name.
void write_normals(const Mesh& mesh, std::size_t first_layer, std::size_t end_layer,
                   Vec3* normals) {
  const std::size_t begin = mesh.layer_vertices[first_layer];
  const std::size_t end = mesh.layer_vertices[end_layer];
  std::fill(normals + begin, normals + end, Vec3{0, 0, 0});
  for (const Triangle& triangle :
       mesh.triangles_of(first_layer == 0 ? 0 : first_layer - 1, end_layer)) {
    const Vec3 normal = area_normal(mesh, triangle);
    for (const std::uint32_t vertex : triangle) {
      if (vertex < begin || vertex >= end) continue;
      for (std::size_t axis = 0; axis < 3; ++axis) normals[vertex][axis] += normal[axis];
    }
  }
  for (std::size_t v = begin; v < end; ++v) normals[v] = unit(normals[v]);
}

}  // namespace

Vec3 area_normal(const Mesh& mesh, const Triangle& triangle) {
  return normal_of(mesh.positions[triangle[0]], mesh.positions[triangle[1]],
                   mesh.positions[triangle[2]]);
}

Vec3 unit(const Vec3& v) {
  const double x = v[0];
  const double y = v[1];
  const double z = v[2];
  // Squares of single-precision numbers fit into double precision.
  const double length = std::sqrt(x * x + y * y + z * z);
  if (length == 0) return {0, 0, 1};
  return {static_cast<float>(x / length), static_cast<float>(y / length),
          static_cast<float>(z / length)};
}

void vertex_normals(const Mesh& mesh, const Context& context, Buffer<Vec3>& normals) {
  normals.resize_for_overwrite(mesh.positions.size());
  if (!mesh.normals.empty()) {
    std::ranges::copy(mesh.normals, normals.begin());
    return;
  }
  const auto write = [&](std::size_t first_layer, std::size_t end_layer) {
    write_normals(mesh, first_layer, end_layer, normals.data());
  };
  for_chunks(context, mesh.layers(), write, kLayersPerSlab);
}

}  // namespace isomesh::mesh
