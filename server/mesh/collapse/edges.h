// The edges of a surface; private to this folder.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/context.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh::collapse {

using Edge = std::array<std::uint32_t, 2>;

// Each edge once, with its lesser vertex.
struct Edges {
  struct End {
    std::uint32_t vertex = 0;  // the greater one
    bool is_odd = false;       // whether the edge has an odd number of triangles
  };

  std::vector<std::size_t> begin;  // of each vertex's in `ends`
  std::vector<std::size_t> end;
  std::vector<End> ends;

  std::span<const End> of(std::size_t vertex) const {
    return std::span(ends).subspan(begin[vertex], end[vertex] - begin[vertex]);
  }
  std::vector<Edge> odd() const;
};

// Throws Error kCancelled.
Edges edges_of(std::size_t vertices, std::span<const Triangle> triangles, const Context& context);

}  // namespace isomesh::mesh::collapse
