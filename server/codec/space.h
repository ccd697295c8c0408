// The spaces that files' coordinates are in; private to this folder and those below.
#pragma once

#include <string_view>

#include "proto/types.h"
#include "server/mesh/mesh.h"

namespace isomesh::codec {

// As it is in LPS, in the other space, and the other way round: half a turn about z, which keeps
// the sense of triangles.
inline mesh::Vec3 in_space(const mesh::Vec3& position, Space space) {
  if (space == Space::kLps) return position;
  return {0 - position[0], 0 - position[1], position[2]};  // no negative zeros
}

// For encoders that take whole meshes. As much memory as the mesh.
mesh::Mesh copy_in_space(const mesh::Mesh& mesh, Space space);

// As files call it.
constexpr std::string_view letters_of(Space space) { return space == Space::kLps ? "LPS" : "RAS"; }

}  // namespace isomesh::codec
