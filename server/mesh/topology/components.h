// The parts of a surface that do not touch, and leaving out the small ones.
#pragma once

#include <cstdint>
#include <vector>

#include "proto/types.h"
#include "server/mesh/buffer.h"
#include "server/mesh/context.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// The component of each vertex; components are numbered from 0 on in the order of their first
// vertices. Two vertices are of one component when triangles connect them.
struct Components {
  Buffer<std::uint32_t> of_vertex;
  std::uint32_t count = 0;
};

// The same for any number of threads. `components`' memory is reused. Throws Error kCancelled.
void find_components(const Mesh& mesh, const Context& context, Components& components);

// As many as find_components finds. Throws Error kCancelled.
std::uint64_t count_components(const Mesh& mesh, const Context& context);

struct Dropped {
  std::uint64_t components = 0;
  std::uint64_t triangles = 0;
};

// How many triangles each component has.
std::vector<std::uint64_t> triangles_of(const Components& components, const Mesh& mesh);

// Leaves out the components that are not kept, in place. Vertices and triangles keep their order
// and their layers. `components` are the mesh's, and indeterminate then.
Dropped leave_out(const std::vector<bool>& kept, const std::vector<std::uint64_t>& triangles,
                  Components& components, Mesh& mesh);

// Leaves only the components that the filter keeps, in place: those of the vertices nearest to
// `filter.nearest_to`, if that is not empty; of these those of at least `filter.min_triangles`, and
// of these the `filter.keep` with the most triangles, of equal ones the first. Vertices and
// triangles keep their order and their layers. The same for any number of threads. Throws Error
// kCancelled before anything is changed.
Dropped keep_components(const ComponentFilter& filter, const Context& context, Mesh& mesh);

}  // namespace isomesh::mesh
