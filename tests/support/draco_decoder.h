// Decodes a Draco stream with Debian's draco_decoder.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

namespace isomesh::test {

struct DecodedMesh {
  std::vector<std::array<float, 3>> points;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

// Runs the command on the stream. Throws std::runtime_error with its message if it is missing or
// fails, or if its output is not a mesh.
DecodedMesh decode_with_command(std::string_view drc);

}  // namespace isomesh::test
