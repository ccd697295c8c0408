// Connected components of a surface, and removal of small ones.
#pragma once

#include <cstdint>
#include <vector>

#include "proto/types.h"
#include "server/mesh/buffer.h"
#include "server/mesh/context.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// The component of each vertex, numbered in the order of their first vertices. Two vertices belong
// to one component if triangles connect them.
struct Components {
  Buffer<std::uint32_t> of_vertex;
  std::uint32_t count = 0;
};

// Does not depend on the number of threads. The memory of `components` is reused. Throws Error
// kCancelled.
void find_components(const Mesh& mesh, const Context& context, Components& components);

// The number of components. Throws Error kCancelled.
std::uint64_t count_components(const Mesh& mesh, const Context& context);

struct Dropped {
  std::uint64_t components = 0;
  std::uint64_t triangles = 0;
};

// The number of triangles of each component.
std::vector<std::uint64_t> triangles_of(const Components& components, const Mesh& mesh);

// Removes all other components in place. Vertices and triangles keep their order and their layers.
// `components` must be the mesh's, and is indeterminate afterwards.
Dropped leave_out(const std::vector<bool>& kept, const std::vector<std::uint64_t>& triangles,
                  Components& components, Mesh& mesh);

// Keeps only the components that the filter selects, in place: those of the vertices nearest to
// `filter.nearest_to`, if it is not empty; of these, those of at least `filter.min_triangles`; of
// these, the `filter.keep` with the most triangles, of equal ones the first. Vertices and triangles
// keep their order and their layers. Does not depend on the number of threads. Throws Error
// kCancelled before anything is changed.
Dropped keep_components(const ComponentFilter& filter, const Context& context, Mesh& mesh);

}  // namespace isomesh::mesh
