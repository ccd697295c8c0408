// The version of the bytes that this program makes.
#pragma once

namespace isomesh::codec {

// A part of the key of a result. Increment whenever the same volume and parameters would give
// different bytes than before.
inline constexpr const char* kMesherVersion = "7";

}  // namespace isomesh::codec
