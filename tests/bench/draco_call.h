// Draco as a user of the library calls it: the whole mesh at once.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "proto/types.h"
#include "server/mesh/mesh.h"

namespace isomesh::bench {

// Encodes by edgebreaker with 14 bits a coordinate at Draco's default speed of 5, and returns the
// number of bytes. `corners` names three vertices per triangle. Throws std::runtime_error when
// Draco refuses.
std::uint64_t encode_in_one_call(std::span<const mesh::Vec3> positions,
                                 std::span<const long long> corners);

// The same with other parameters and triangles of ours. Returns the stream.
std::string encode_in_one_call(std::span<const mesh::Vec3> positions,
                               std::span<const mesh::Triangle> triangles,
                               const DracoParameters& parameters);

// The number of triangles that a stream decodes to. Throws std::runtime_error when Draco refuses.
std::uint64_t decode_in_one_call(std::string_view drc);

}  // namespace isomesh::bench
