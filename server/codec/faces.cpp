#include "server/codec/faces.h"

#include <limits>
#include <string>

#include "proto/error.h"

namespace isomesh::codec {

std::vector<FaceRun> faces_of(const mesh::Mesh& mesh) {
  return {{.count = mesh.triangles.size(), .label = 0, .at = [&mesh](std::size_t t) {
             return mesh.triangles[t];
           }}};
}

std::vector<FaceRun> faces_of(const LabelledSurface& surface) {
  std::vector<FaceRun> runs;
  for (std::size_t n = 1; n <= surface.labels.size(); ++n) {
    const auto own = surface.triangles.of(n);
    const auto face = [&walls = surface.walls, own, n](std::size_t t) {
      const mesh::Triangle& wall = walls.mesh.triangles[own[t]];
      const bool is_inside_out = walls.parts.belongs(walls.sides[own[t]].front, n);
      return is_inside_out ? mesh::Triangle{wall[0], wall[2], wall[1]} : wall;
    };
    const auto label = static_cast<std::uint32_t>(surface.labels[n - 1].label);
    runs.push_back({.count = own.size(), .label = label, .at = face});
  }
  return runs;
}

std::size_t count_of(const std::vector<FaceRun>& runs) {
  std::size_t faces = 0;
  for (const FaceRun& run : runs) faces += run.count;
  return faces;
}

bool has_wide_labels(const LabelledSurface& surface) {
  return !surface.labels.empty() &&
         surface.labels.back().label > std::numeric_limits<std::int32_t>::max();
}

void check_signed_indices(std::size_t vertices, std::size_t triangles, MeshFormat format) {
  constexpr std::size_t kMost = std::numeric_limits<std::int32_t>::max();
  if (vertices <= kMost && triangles <= kMost / 3) return;
  throw Error(ErrorCode::kTooLarge,
              "The surface has more vertices or triangles than a file of the "
              "format " +
                  std::string(to_string(format)) + " can hold. Set \"triangles\" to simplify it.");
}

}  // namespace isomesh::codec
