#include "server/codec/faces.h"

#include <limits>
#include <string>
#include <utility>

#include "proto/error.h"

namespace isomesh::codec {

std::vector<FaceRun> faces_of(const FileContent& content) {
  if (content.labels == nullptr) return {FaceRun(content.mesh)};
  std::vector<FaceRun> runs;
  for (std::size_t n = 0; n < content.labels->labels.size(); ++n) {
    runs.emplace_back(content.labels->surfaces[n], content.labels->labels[n].label);
  }
  return runs;
}

std::size_t count_of(const std::vector<FaceRun>& runs) {
  std::size_t faces = 0;
  for (const FaceRun& run : runs) faces += run.count();
  return faces;
}

LabelType label_type(const LabelledSurface& surface) {
  if (surface.labels.empty()) return LabelType::kInt32;
  const std::int64_t low = surface.labels.front().label;
  const std::int64_t high = surface.labels.back().label;
  if (std::in_range<std::int32_t>(low) && std::in_range<std::int32_t>(high))
    return LabelType::kInt32;
  return low >= 0 && std::in_range<std::uint32_t>(high) ? LabelType::kUint32 : LabelType::kInt64;
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
