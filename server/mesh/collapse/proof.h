// The proof that two surfaces are within a distance of each other; private to this folder. It
// shares no code with what made them.
//
// F is linear in each tetrahedron of the lattice, and S is where F is zero. T carries two copies of
// itself: vertex p of T is `in` in T+ and `out` in T-. If
//   1. each edge of T has an even number of triangles, or p, in and out of both its ends lie in one
//      face of the volume;
//   2. |in - p| <= e and |out - p| <= e for each vertex of T;
//   3. F > 0 on all of T+ and F < 0 on all of T-;
//   4. a ray from one point of each component K of S crosses K's own triangles of T+ and T- an odd
//      number of times in all,
// then every point of T is within e of S, and every point of S within e of T:
//   T to S. A point x of T moves linearly with its triangle to x+ in T+ and x- in T-, both within e
//   of x. F changes its sign on the way from x+ to x-, which a ball around x contains.
//   S to T. f(x, s) runs from x- through x to x+ and moves nothing farther than e. K meets neither
//   T+ nor T- (3), the ends of the image of f, and 1 leaves it no other. So the degree of f modulo
//   2 is the same all over K, and the ray counts it: it is odd, and all of K lies in the image.
// Beyond the volume's faces S, T, T+ and T- go on straight outward.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/collapse/field.h"
#include "server/mesh/collapse/tube.h"
#include "server/mesh/context.h"
#include "server/mesh/mesh.h"
#include "server/mesh/topology/components.h"

namespace isomesh::mesh::collapse {

struct Surfaces {
  std::span<const Crossing> crossings;     // S: its vertices,
  std::span<const Triangle> extracted;     // triangles between them,
  const Components& components;            // and what they connect
  std::span<const Vertex> vertices;        // T, in numbers of samples
  std::span<const Triangle> triangles;     // and triangles between them
  std::span<const std::uint32_t> origins;  // of each vertex of T: a crossing of its component of S

  std::uint32_t component_of(std::uint32_t vertex) const {
    return components.of_vertex[origins[vertex]];
  }
};

struct Proof {
  std::size_t open_edges = 0;            // 1 fails
  std::size_t unclear_triangles = 0;     // 3 fails
  std::vector<std::uint32_t> uncovered;  // 4 fails: these components

  bool is_clear() const { return open_edges == 0 && unclear_triangles == 0; }
  bool holds() const { return is_clear() && uncovered.empty(); }
};

// Proves 1, 3 and, if those hold, 4. Throws Error kCancelled.
Proof prove(const Field& field, const Surfaces& surfaces, const Context& context);

}  // namespace isomesh::mesh::collapse
