#include "server/codec/space.h"

#include "server/codec/levels.h"

namespace isomesh::codec {

mesh::Mesh copy_in_space(const mesh::Mesh& mesh, Space space) {
  mesh::Mesh turned = copy_of(mesh);
  for (mesh::Vec3& position : turned.positions) position = in_space(position, space);
  return turned;
}

}  // namespace isomesh::codec
