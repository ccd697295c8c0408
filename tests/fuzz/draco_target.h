// The target that encodes meshes which bytes make up.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace isomesh::fuzz {

// Encodes a mesh as a Draco stream and as GLB's blocks, by our own encoder where that takes it and
// by libdraco, and decodes with libdraco: the same triangles with orientation, on the grid. Throws
// std::logic_error when they are not.
void encode_mesh(std::span<const std::byte> bytes);

std::vector<std::string> meshes_to_encode();

}  // namespace isomesh::fuzz
