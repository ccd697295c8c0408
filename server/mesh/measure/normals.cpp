#include "server/mesh/measure/normals.h"

#include <algorithm>
#include <cmath>

#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

// Each run looks at the triangles of one more layer.
constexpr std::size_t kLayersPerSlab = 16;

Vec3 operator-(const Vec3& a, const Vec3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

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
  const Vec3& corner = mesh.positions[triangle[0]];
  const Vec3 u = mesh.positions[triangle[1]] - corner;
  const Vec3 v = mesh.positions[triangle[2]] - corner;
  return {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
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
  const std::size_t slabs = (mesh.layers() + kLayersPerSlab - 1) / kLayersPerSlab;
  parallel_for(context, slabs, [&](std::size_t slab) {
    const std::size_t first = slab * kLayersPerSlab;
    write_normals(mesh, first, std::min(mesh.layers(), first + kLayersPerSlab), normals.data());
  });
}

}  // namespace isomesh::mesh
