// The lines where walls meet, on their way to fewer vertices; private to this folder.
#pragma once

#include <span>

#include "server/mesh/collapse/simplify_block.h"

namespace isomesh::mesh {

// Takes vertices out of the lines where walls meet, for all walls that meet there at once: each is
// drawn into a neighbour on its line, as long as the walls stay what they are as surfaces and near
// where they were. `block` has triangles of several walls; of their vertices those that `is_free`
// says, a flag for each vertex of the mesh, have no triangles elsewhere, and only these may go.
// Points where lines meet or end stay. A collapse of an edge keeps the complex of the walls what it
// is where the links of its ends share nothing but its own (T. K. Dey, H. Edelsbrunner, S. Guha,
// D. V. Nekhayev, "Topology preserving edge contraction", Publications de l'Institut
// Mathématique 66, 1999).
//
// Without a grid nothing is measured, and of the vertices of lines as great a share stays as would
// stay of a length whose square is the goal's share. Thread safe for different blocks.
void simplify_lines(const BlockGoal& goal, std::span<const std::uint8_t> is_free,
                    SurfaceBlock& block);

}  // namespace isomesh::mesh
