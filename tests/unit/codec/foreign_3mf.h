// 3MF files as the 3MF Consortium's own library reads them.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/mesh/mesh.h"

namespace isomesh::test {

struct Object3mf {
  std::string name;
  std::string part_number;
  bool is_model = false;  // or of another type
  std::optional<std::array<std::uint8_t, 3>> color = {};
  std::vector<mesh::Vec3> points;
  std::vector<mesh::Triangle> triangles;
};

struct Model3mf {
  bool is_in_millimetres = false;
  std::map<std::string, std::string> metadata;
  std::size_t items = 0;           // the build's
  std::string together;            // the name of an object that has components
  std::vector<Object3mf> objects;  // that are built, with a mesh, in their order
};

// Throws std::runtime_error where lib3mf refuses the file, or warns of anything, and for objects
// that the file moves or turns.
Model3mf read_with_lib3mf(const std::string& bytes);

}  // namespace isomesh::test
