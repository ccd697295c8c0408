#include "tests/unit/codec/foreign.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <span>
#include <stdexcept>
#include <tuple>
#include <utility>

#include <assimp/cimport.h>
#include <assimp/scene.h>

#include "tests/support/files.h"
#include "tests/support/process.h"
#include "tests/unit/codec/foreign_3mf.h"
#include "tests/unit/codec/foreign_cgal.h"
#include "tests/unit/codec/usd_reader.h"

namespace isomesh::test {
namespace {

// Takes whole values off the front of some bytes.
class Bytes {
 public:
  explicit Bytes(const std::string& bytes) : rest_(bytes) {}

  bool empty() const { return rest_.empty(); }

  template <class T>
  void take(std::span<T> values) {
    if (rest_.size() < values.size_bytes())
      throw std::runtime_error("the reader's output is short");
    if (values.empty()) return;  // its data may be null, which memcpy does not take
    std::memcpy(values.data(), rest_.data(), values.size_bytes());
    rest_.remove_prefix(values.size_bytes());
  }

 private:
  std::string_view rest_;
};

}  // namespace

std::vector<std::array<mesh::Vec3, 3>> read_with_assimp(const std::string& bytes,
                                                        const std::string& suffix) {
  const aiScene* scene =
      aiImportFileFromMemory(bytes.data(), static_cast<unsigned>(bytes.size()), 0, suffix.c_str());
  if (scene == nullptr) throw std::runtime_error(aiGetErrorString());
  std::vector<std::array<mesh::Vec3, 3>> triangles;
  for (const aiMesh* mesh : std::span(scene->mMeshes, scene->mNumMeshes)) {
    for (const aiFace& face : std::span(mesh->mFaces, mesh->mNumFaces)) {
      if (face.mNumIndices != 3) throw std::runtime_error("a face has not three corners");
      auto& corners = triangles.emplace_back();
      for (std::size_t corner = 0; corner < 3; ++corner) {
        const aiVector3D& at = mesh->mVertices[face.mIndices[corner]];
        corners[corner] = {at.x, at.y, at.z};
      }
    }
  }
  aiReleaseImport(scene);
  return triangles;
}

std::vector<std::string> objects_in(const std::string& bytes, const std::string& suffix) {
  const aiScene* scene =
      aiImportFileFromMemory(bytes.data(), static_cast<unsigned>(bytes.size()), 0, suffix.c_str());
  if (scene == nullptr) throw std::runtime_error(aiGetErrorString());
  std::vector<std::string> names;
  for (const aiMesh* mesh : std::span(scene->mMeshes, scene->mNumMeshes)) {
    names.emplace_back(mesh->mName.C_Str());
  }
  aiReleaseImport(scene);
  return names;
}

std::vector<GlbPrimitive> read_with_node(const std::string& glb) {
  const TemporaryFolder folder;
  write_file(folder / "mesh.glb", glb);
  const Finished finished = run({"node", ISOMESH_READ_GLB, folder / "mesh.glb", folder / "out"});
  if (finished.status != 0) throw std::runtime_error(finished.errors);
  const std::string out = read_file(folder / "out");
  std::vector<GlbPrimitive> primitives;
  for (Bytes bytes(out); !bytes.empty();) {
    std::array<std::uint32_t, 4> counts;
    bytes.take(std::span<std::uint32_t>(counts));
    GlbPrimitive& primitive = primitives.emplace_back();
    primitive.mesh.points.resize(counts[0]);
    primitive.mesh.triangles.resize(counts[1]);
    primitive.normals.resize(counts[2]);
    primitive.distances.resize(counts[3]);
    bytes.take(std::span(primitive.mesh.points));
    bytes.take(std::span(primitive.normals));
    bytes.take(std::span(primitive.distances));
    bytes.take(std::span(primitive.mesh.triangles));
  }
  return primitives;
}

ForeignSurface read_with_python(const std::string& bytes, MeshFormat format) {
  const TemporaryFolder folder;
  const std::string file = folder / ("mesh." + std::string(to_string(format)));
  write_file(file, bytes);
  // Debian's own, which has its packages.
  const Finished finished = run({"/usr/bin/python3", ISOMESH_READ_SURFACE, file, folder / "out"});
  if (finished.status != 0) throw std::runtime_error(finished.errors);
  const std::string out = read_file(folder / "out");
  Bytes rest(out);
  std::array<std::uint32_t, 4> counts;
  rest.take(std::span<std::uint32_t>(counts));
  ForeignSurface surface;
  surface.mesh.points.resize(counts[0]);
  surface.mesh.triangles.resize(counts[1]);
  surface.labels.resize(counts[2]);
  std::string text(counts[3], '\0');
  rest.take(std::span(surface.mesh.points));
  rest.take(std::span(surface.mesh.triangles));
  rest.take(std::span(surface.labels));
  rest.take(std::span(text.data(), text.size()));
  surface.told = nlohmann::json::parse(text);
  return surface;
}

bool is_read_by_python(MeshFormat format) {
  constexpr std::array kOthers = {MeshFormat::kStl, MeshFormat::kPly, MeshFormat::kObj,
                                  MeshFormat::kOff, MeshFormat::k3mf, MeshFormat::kUsda,
                                  MeshFormat::kUsdz};
  return std::ranges::find(kOthers, format) == kOthers.end();
}

std::vector<std::array<mesh::Vec3, 3>> read_exactly(const std::string& bytes, MeshFormat format) {
  std::vector<std::array<mesh::Vec3, 3>> triangles;
  const auto add = [&](const auto& points, const auto& corners) {
    for (const auto& [a, b, c] : corners) triangles.push_back({points[a], points[b], points[c]});
  };
  switch (format) {
    case MeshFormat::kStl:
    case MeshFormat::kPly:
    case MeshFormat::kGlb:
      return read_with_assimp(bytes, std::string(to_string(format)));
    case MeshFormat::kObj:
    case MeshFormat::kOff: {
      const DecodedMesh mesh = read_with_cgal(bytes, format);
      add(mesh.points, mesh.triangles);
      break;
    }
    case MeshFormat::k3mf:
      for (const Object3mf& object : read_with_lib3mf(bytes).objects) {
        add(object.points, object.triangles);
      }
      break;
    case MeshFormat::kUsda:
    case MeshFormat::kUsdz: {
      const bool is_text = format == MeshFormat::kUsda;
      for (UsdMesh& mesh : read_usda(is_text ? bytes : first_file_of_usdz(bytes)).meshes) {
        for (auto& [x, y, z] : mesh.points) std::tie(y, z) = std::pair(-z, y);  // to LPS
        add(mesh.points, mesh.triangles);
      }
      break;
    }
    default: {
      const DecodedMesh mesh = read_with_python(bytes, format).mesh;
      add(mesh.points, mesh.triangles);
    }
  }
  return triangles;
}

}  // namespace isomesh::test
