#include "server/codec/levels.h"

#include <algorithm>

#include "server/mesh/collapse/simplify.h"

namespace isomesh::codec {
namespace {

// Measured on a surface of 1.3 million triangles: a level with a twentieth of them is five times as
// accurate if it is made by way of a quarter, at almost the same time.
constexpr std::uint64_t kMostAtOnce = 4;

template <class T>
void copy(const mesh::Buffer<T>& from, mesh::Buffer<T>& to) {
  to.resize_for_overwrite(from.size());
  std::ranges::copy(from, to.begin());
}

template <class Surface>
void coarsen_in_steps(std::uint64_t triangles, const mesh::Context& context, const mesh::Mesh& mesh,
                      Surface& surface) {
  double begin = 0;
  for (bool is_last = false; !is_last && mesh.triangles.size() > triangles;) {
    const std::uint64_t nearer = mesh.triangles.size() / kMostAtOnce;
    is_last = nearer <= triangles;
    // Each step has a fraction of the previous step's work.
    const double end = is_last ? 1 : begin + (1 - begin) * (1 - 1.0 / kMostAtOnce);
    // All levels have the places of the finest one, whose grid they are rounded to.
    const mesh::SimplificationEffect effect = simplify(
        {.triangles = std::max({triangles, nearer, std::uint64_t{1}}), .keeps_volume = false},
        context.part(begin, end), surface);
    if (effect.triangles_after == effect.triangles_before) return;
    begin = end;
  }
}

}  // namespace

mesh::Mesh copy_of(const mesh::Mesh& mesh) {
  mesh::Mesh result;
  result.origin = mesh.origin;
  result.reach = mesh.reach;
  copy(mesh.positions, result.positions);
  copy(mesh.triangles, result.triangles);
  result.layer_vertices = mesh.layer_vertices;
  result.layer_triangles = mesh.layer_triangles;
  result.on_border = mesh.on_border;
  result.on_line = mesh.on_line;
  result.normals = mesh.normals;
  return result;
}

mesh::SeparatingSurface copy_of(const mesh::SeparatingSurface& walls) {
  mesh::SeparatingSurface result;
  result.mesh = copy_of(walls.mesh);
  copy(walls.sides, result.sides);
  result.labels = walls.labels;
  result.parts = walls.parts;
  return result;
}

void coarsen(std::uint64_t triangles, const mesh::Context& context, mesh::Mesh& mesh) {
  coarsen_in_steps(triangles, context, mesh, mesh);
}

void coarsen(std::uint64_t triangles, const mesh::Context& context,
             mesh::SeparatingSurface& walls) {
  coarsen_in_steps(triangles, context, walls.mesh, walls);
}

}  // namespace isomesh::codec
