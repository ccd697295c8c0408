// Draco streams as libdraco decodes them.
#pragma once

#include <string_view>
#include <vector>

#include "tests/support/draco_decoder.h"

namespace isomesh::test {

// Points and triangles in the stream's order. Throws std::runtime_error when it is not a mesh.
DecodedMesh decode_in_process(std::string_view drc);

// The numbers of all points by attribute, in the stream's order. Throws as the above.
std::vector<std::vector<float>> attributes_in_process(std::string_view drc);

}  // namespace isomesh::test
