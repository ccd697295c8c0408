// Draco as a user of the library calls it: the whole mesh at once.
#pragma once

#include <cstdint>
#include <span>

#include "server/mesh/mesh.h"

namespace isomesh::bench {

// Encodes by edgebreaker with 14 bits a coordinate at Draco's default speed of 5, and returns the
// number of bytes. `corners` names three vertices per triangle. Throws std::runtime_error when
// Draco refuses.
std::uint64_t encode_in_one_call(std::span<const mesh::Vec3> positions,
                                 std::span<const long long> corners);

}  // namespace isomesh::bench
