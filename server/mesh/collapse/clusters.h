// The crossings that a regularised surface joins, in terms of the plain surface; private to this
// folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/collapse/field.h"
#include "server/mesh/context.h"
#include "server/mesh/lattice/placement.h"

namespace isomesh::mesh::collapse {

// Sets of crossings. No crossing is in two of them.
struct Clusters {
  std::vector<std::uint32_t> begin = {0};  // of each set in `crossings`, and the end
  std::vector<std::uint32_t> crossings;    // of a set in ascending order

  std::size_t size() const { return begin.size() - 1; }
  std::span<const std::uint32_t> members(std::size_t k) const {
    return std::span(crossings).subspan(begin[k], begin[k + 1] - begin[k]);
  }
};

// Throws Error kCancelled.
template <class T>
Clusters find_clusters(const Lattice<T>& lattice, const ExtractOptions& options, const Field& field,
                       const Crossings& crossings, const Context& context);

}  // namespace isomesh::mesh::collapse
