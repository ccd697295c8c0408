// The triangles of a file, of one surface or of labels. Private to this folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/codec/encode.h"
#include "server/mesh/mesh.h"

namespace isomesh::codec {

// The triangles of one surface, or of one label's own surface. Its content must outlive it. Thread
// safe.
class FaceRun {
 public:
  explicit FaceRun(const mesh::Mesh& mesh) : mesh_(mesh) {}
  FaceRun(const mesh::LabelSurface& surface, std::int64_t label)
      : mesh_(surface.mesh), walls_(surface.vertices.span()), label_(label) {}

  std::size_t count() const { return mesh_.triangles.size(); }
  std::int64_t label() const { return label_; }

  mesh::Triangle at(std::size_t index) const {
    const auto& [a, b, c] = mesh_.triangles[index];
    if (walls_.empty()) return {a, b, c};
    return {walls_[a], walls_[b], walls_[c]};
  }

 private:
  const mesh::Mesh& mesh_;
  std::span<const std::uint32_t> walls_;  // the number of each vertex there
  std::int64_t label_ = 0;
};

// A run for each label, or one.
std::vector<FaceRun> faces_of(const FileContent& content);

std::size_t count_of(const std::vector<FaceRun>& runs);

// The integers that hold all labels of a surface.
enum class LabelType { kInt32, kUint32, kInt64 };
LabelType label_type(const LabelledSurface& surface);

// Throws Error kTooLarge with the format's name if signed 32-bit numbers cannot count the vertices
// or the triangles' corners.
void check_signed_indices(std::size_t vertices, std::size_t triangles, MeshFormat format);

}  // namespace isomesh::codec
