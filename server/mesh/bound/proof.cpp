#include "server/mesh/bound/proof.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "server/mesh/bound/cover.h"
#include "server/mesh/bound/one_sign.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh::bound {
namespace {

constexpr std::size_t kTrianglesPerChunk = 1 << 12;

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

bool is_clear(const Field& field, const Surfaces& surfaces, const Triangle& triangle,
              Vecf Vertex::*side, double sign) {
  const auto place = [&](std::size_t i) { return wide(surfaces.vertices[triangle[i]].*side); };
  return has_one_sign(field, place(0), place(1), place(2), sign);
}

std::size_t count_unclear(const Field& field, const Surfaces& surfaces,
                          std::span<const std::uint32_t> components, const Context& context) {
  std::atomic<std::size_t> unclear = 0;
  const std::size_t count = surfaces.triangles.size();
  parallel_for(
      context, (count + kTrianglesPerChunk - 1) / kTrianglesPerChunk, [&](std::size_t chunk) {
        for (std::size_t t = chunk * kTrianglesPerChunk;
             t < std::min(count, (chunk + 1) * kTrianglesPerChunk); ++t) {
          const Triangle& triangle = surfaces.triangles[t];
          const auto component = [&](std::size_t i) {
            return components[surfaces.origins[triangle[i]]];
          };
          const bool is_of_one = component(0) == component(1) && component(0) == component(2);
          if (!is_of_one || !is_clear(field, surfaces, triangle, &Vertex::in, 1) ||
              !is_clear(field, surfaces, triangle, &Vertex::out, -1)) {
            ++unclear;
          }
        }
      });
  return unclear;
}

}  // namespace

Proof prove(const Field& field, const Surfaces& surfaces, const Context& context) {
  Proof proof;
  const std::vector<std::uint32_t> components =
      components_of(surfaces.crossings.size(), surfaces.extracted);
  for (std::uint32_t e = 0; e < components.size(); ++e) {
    proof.components += components[e] == e ? 1 : 0;
  }
  const std::vector<Edge> border = odd_edges(surfaces.vertices.size(), surfaces.triangles);
  for (const auto& [a, b] : border) {
    if (!is_in_one_face(field.dims, surfaces.vertices[a], surfaces.vertices[b])) {
      ++proof.open_edges;
    }
  }
  proof.unclear_triangles = count_unclear(field, surfaces, components, context);
  // Rays count on triangles that lie in the volume.
  if (proof.holds()) proof.uncovered = uncovered(field, surfaces, components, border, context);
  return proof;
}

}  // namespace isomesh::mesh::bound
