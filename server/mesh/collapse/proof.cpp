#include "server/mesh/collapse/proof.h"

#include <algorithm>
#include <atomic>

#include "server/mesh/collapse/cover.h"
#include "server/mesh/collapse/one_sign.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh::collapse {
namespace {

bool is_in_one_face(const Dims& dims, const Vertex& a, const Vertex& b) {
  const auto all_at = [&](float Vecf::*axis, float face) {
    return std::ranges::all_of(std::array{a.p, a.in, a.out, b.p, b.in, b.out},
                               [&](const Vecf& p) { return p.*axis == face; });
  };
  const auto is_in = [&](float Vecf::*axis, std::uint32_t samples) {
    return all_at(axis, 0) || all_at(axis, static_cast<float>(samples - 1));
  };
  return is_in(&Vecf::x, dims.x) || is_in(&Vecf::y, dims.y) || is_in(&Vecf::z, dims.z);
}

// How many triangles of T+ or T- have a point where sign * F is not positive, or more: each vertex
// and each edge of those is counted.
std::size_t count_unclear(const Field& field, const Surfaces& surfaces, const Edges& edges,
                          Vecf Vertex::*side, double sign, const Context& context) {
  const OneSign signs(field, sign);
  const auto place = [&](std::uint32_t v) { return wide(surfaces.vertices[v].*side); };
  std::atomic<std::size_t> unclear = 0;
  for_each(context, surfaces.vertices.size(), [&](std::size_t v) {
    const Vecd from = place(static_cast<std::uint32_t>(v));
    if (!signs.at(from)) ++unclear;
  });
  if (unclear != 0) return unclear;  // some may be outside of the volume
  for_each(context, surfaces.vertices.size(), [&](std::size_t v) {
    const Vecd from = place(static_cast<std::uint32_t>(v));
    for (const Edges::End& end : edges.of(v)) {
      if (!signs.along(from, place(end.vertex))) ++unclear;
    }
  });
  for_each(context, surfaces.triangles.size(), [&](std::size_t t) {
    const auto& [a, b, c] = surfaces.triangles[t];
    if (!signs.within(place(a), place(b), place(c))) ++unclear;
  });
  return unclear;
}

bool is_of_one_component(const Surfaces& surfaces, const Triangle& triangle) {
  const auto& [a, b, c] = triangle;
  const std::uint32_t component = surfaces.component_of(a);
  return component == surfaces.component_of(b) && component == surfaces.component_of(c);
}

}  // namespace

Proof prove(const Field& field, const Surfaces& surfaces, const Context& context) {
  Proof proof;
  const Edges edges = edges_of(surfaces.vertices.size(), surfaces.triangles, context);
  const std::vector<Edge> border = edges.odd();
  for (const auto& [a, b] : border) {
    if (!is_in_one_face(field.dims, surfaces.vertices[a], surfaces.vertices[b])) {
      ++proof.open_edges;
    }
  }
  proof.unclear_triangles = count_unclear(field, surfaces, edges, &Vertex::in, 1, context) +
                            count_unclear(field, surfaces, edges, &Vertex::out, -1, context);
  for (const Triangle& triangle : surfaces.triangles) {
    if (!is_of_one_component(surfaces, triangle)) ++proof.unclear_triangles;
  }
  if (proof.is_clear()) proof.uncovered = uncovered(field, surfaces, border, context);
  return proof;
}

}  // namespace isomesh::mesh::collapse
