// Checks that a Draco stream decodes to the mesh that was encoded.
#pragma once

#include <string>
#include <string_view>

#include "proto/types.h"
#include "server/mesh/mesh.h"
#include "tests/support/draco_decoder.h"

namespace isomesh::test {

// Describes how a decoded mesh differs from the encoded one; empty if it does not. Triangles are
// compared in any order, with their orientation. Each corner must be exactly where the grid has it.
// There must be as many points as vertices that triangles use. With kYes there may be more, because
// vertices of several fans may be split.
enum class MaySplit { kNo, kYes };
std::string difference(const DecodedMesh& decoded, const mesh::Mesh& mesh, int position_bits,
                       MaySplit may_split = MaySplit::kNo);

// The same of a stream as libdraco decodes it; when it refuses, its words.
std::string difference(std::string_view drc, const mesh::Mesh& mesh, int position_bits,
                       MaySplit may_split = MaySplit::kNo);

}  // namespace isomesh::test
