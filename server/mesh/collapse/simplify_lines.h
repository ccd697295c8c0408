// The lines where walls meet, on their way to fewer vertices; private to this folder.
#pragma once

#include <span>

#include "server/mesh/collapse/simplify_patch.h"
#include "server/mesh/labels/separate.h"

namespace isomesh::mesh::collapse {

// Takes vertices out of the lines where walls meet, for all walls that meet there at once: each is
// drawn into a neighbour on its line, as long as the walls stay what they are as surfaces and near
// where they were. `sides`: by the triangles' numbers. Those that stay or have triangles elsewhere,
// which `stays` tells, do not go, nor do points where lines meet or end. A collapse of an edge
// keeps the complex of the walls what it is where the links of its ends share nothing but its own
// (T. K. Dey, H. Edelsbrunner, S. Guha, D. V. Nekhayev, "Topology preserving edge contraction",
// Publications de l'Institut Mathématique 66, 1999).
//
// If nothing is measured, as great a share of the vertices of lines stays as would stay of a length
// whose square is `share`. Thread safe for different patches.
void simplify_lines(const SimplifySurroundings& around, std::span<const WallSides> sides,
                    double share, Patch& patch);

}  // namespace isomesh::mesh::collapse
