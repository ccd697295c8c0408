// Coordinate spaces of files. Private to this folder and its subfolders.
#pragma once

#include <string>
#include <string_view>

#include "proto/notes.h"
#include "proto/types.h"
#include "server/mesh/mesh.h"

namespace isomesh::codec {

// Converts between LPS and `space`, in either direction: a half turn about z, which keeps the
// triangles' orientation.
inline mesh::Vec3 in_space(const mesh::Vec3& position, Space space) {
  if (space == Space::kLps) return position;
  return {0 - position[0], 0 - position[1], position[2]};  // avoids negative zeros
}

inline mesh::Reach in_space(const mesh::Reach& box, Space space) {
  if (space == Space::kLps) return box;
  return {{0 - box.high[0], 0 - box.high[1], box.low[2]},
          {0 - box.low[0], 0 - box.low[1], box.high[2]}};
}

constexpr std::string_view letters_of(Space space) { return space == Space::kLps ? "LPS" : "RAS"; }

// The unit and the space of the coordinates, for a header, a title or the first comment of a file:
// "millimetres, SPACE=LPS". 3D Slicer finds "SPACE=" there in STL, VTK, PLY and OBJ, and takes
// files without it for LPS (vtkMRMLModelStorageNode.cxx).
inline std::string unit_and_space(const LengthUnit& unit, Space space) {
  return std::string(unit.name) + ", SPACE=" + std::string(letters_of(space));
}

}  // namespace isomesh::codec
