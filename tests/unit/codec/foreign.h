// Mesh files as readers of other projects read them.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "proto/types.h"
#include "server/mesh/mesh.h"
#include "tests/support/draco_decoder.h"

namespace isomesh::test {

// The triangles in the file's order, each as its corners' places, as Debian's assimp reads them;
// `suffix` such as "stl" says the format. Throws std::runtime_error with its words when it refuses.
std::vector<std::array<mesh::Vec3, 3>> read_with_assimp(const std::string& bytes,
                                                        const std::string& suffix);

// The names of the objects with triangles that assimp finds, in its order. Throws as the above.
std::vector<std::string> objects_in(const std::string& bytes, const std::string& suffix);

struct GlbPrimitive {
  DecodedMesh mesh;
  std::vector<mesh::Vec3> normals;  // of the points, or none
  std::vector<float> distances;     // of the points, or none
};

// A GLB file's primitives as draco3d or meshoptimizer decodes them, once gltf-validator has neither
// an error nor a warning. All are npm's and run in node. Points are in LPS millimetres. Throws
// std::runtime_error with their words.
std::vector<GlbPrimitive> read_with_node(const std::string& glb);

// A surface as VTK and nibabel find it.
struct ForeignSurface {
  DecodedMesh mesh;
  std::vector<std::int64_t> labels;  // of the triangles, or none
  nlohmann::json told;               // what the file says of itself
};

// A file of the format vtk, vtp or glb as Debian's VTK reads it, one of gii as nibabel does, in
// Python. The points of a glb are where its nodes put them, in metres. Throws std::runtime_error
// with their words.
ForeignSurface read_with_python(const std::string& bytes, MeshFormat format);

// True for the formats that none of the other readers of read_exactly() reads.
bool is_read_by_python(MeshFormat format);

// The triangles of a file that rounds nothing, in its order, each as its corners' places, as a
// reader that is not ours finds them, to the bit: assimp those of stl, ply and glb, which is read
// without its nodes' transformations, CGAL of obj and off,
// lib3mf of all objects of a 3mf, usd_reader.h of usda and usdz, in LPS, and Python of the others.
// Throws std::runtime_error with their words.
std::vector<std::array<mesh::Vec3, 3>> read_exactly(const std::string& bytes, MeshFormat format);

}  // namespace isomesh::test
