// The last triangles on the way to a number of them; private to this folder.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/context.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// Collapses one edge after the other, the least distance first, until `triangles` are left or no
// collapse is possible: where blocks of a surface cannot come to a few triangles, since their seams
// stay and what is proposed for them may be no surface. Those of `current` are triangles of `mesh`,
// with their walls where they are walls. Vertices on a boundary, of Mesh::on_line, of several
// walls, of very many triangles and of `held` stay; the surface stays of its kind, and no triangle
// loses its area. A closed surface without handles can come to four triangles. Takes 100 bytes a
// triangle. Throws Error kCancelled.
void simplify_last(std::uint64_t triangles, std::span<const std::uint8_t> held,
                   const Context& context, const Mesh& mesh, std::vector<Triangle>& current,
                   std::vector<WallSides>& sides);

// True if simplify_last would find no edge to collapse.
bool is_least(std::span<const std::uint8_t> held, const Mesh& mesh,
              const std::vector<Triangle>& current, const std::vector<WallSides>& sides);

}  // namespace isomesh::mesh
