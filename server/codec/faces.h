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
  // `number` counts the labels from 1.
  FaceRun(const LabelledSurface& surface, std::size_t number);

  std::size_t count() const { return surface_ == nullptr ? mesh_.triangles.size() : own_.size(); }
  std::int64_t label() const { return label_; }

  mesh::Triangle at(std::size_t index) const {
    return surface_ == nullptr ? mesh_.triangles[index] : outward(own_[index]);
  }

 private:
  mesh::Triangle outward(std::uint32_t wall) const;

  const mesh::Mesh& mesh_;
  const LabelledSurface* surface_ = nullptr;
  std::span<const std::uint32_t> own_;
  std::size_t number_ = 0;
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
