// Whether a Draco stream decodes to the mesh that was encoded.
#pragma once

#include <string>
#include <string_view>

#include "proto/types.h"
#include "server/mesh/mesh.h"
#include "tests/support/draco_decoder.h"

namespace isomesh::test {

// What is wrong with the mesh that a stream decoded to; empty when nothing is. The triangles are to
// be the same as a set with orientation, each corner where the grid has it to the bit, and the
// points as many as the triangles of the mesh name, or more where `may_split` says that vertices of
// several fans became several.
enum class MaySplit { kNo, kYes };
std::string difference(const DecodedMesh& decoded, const mesh::Mesh& mesh, int position_bits,
                       MaySplit may_split = MaySplit::kNo);

// The same of a stream as libdraco decodes it; when it refuses, its words.
std::string difference(std::string_view drc, const mesh::Mesh& mesh, int position_bits,
                       MaySplit may_split = MaySplit::kNo);

}  // namespace isomesh::test
