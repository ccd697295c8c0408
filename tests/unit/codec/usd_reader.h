// A small, strict reader of the USD that isomesh writes. Debian has no library that reads USD; the
// reader shares no code with the encoder.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "server/mesh/mesh.h"

namespace isomesh::test {

struct UsdMesh {
  std::string prim;
  std::string title;                        // its displayName
  std::int64_t label = 0;                   // in its custom data
  std::vector<mesh::Vec3> points, normals;  // as they are in the file
  std::vector<mesh::Triangle> triangles;
  std::vector<mesh::Vec3> extent;
  mesh::Vec3 color = {};           // primvars:displayColor
  mesh::Vec3 material_color = {};  // of the material that it is bound to
};

struct UsdStage {
  std::string provenance, default_prim, up_axis;
  double metres_per_unit = 0;
  std::vector<UsdMesh> meshes;
};

// Throws std::runtime_error if the text is anything else.
UsdStage read_usda(const std::string& text);

// The first file of a package. Throws std::runtime_error if it is compressed, is not USDA by its
// name, or does not begin at a multiple of 64 bytes.
std::string first_file_of_usdz(const std::string& bytes);

}  // namespace isomesh::test
