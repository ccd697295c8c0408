// The triangles of a file, of one surface or of labels. Private to this folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "server/codec/encode_labels.h"
#include "server/mesh/mesh.h"

namespace isomesh::codec {

// The triangles of one label. Several threads may call `at`; its source must outlive it.
struct FaceRun {
  std::size_t count = 0;
  std::uint32_t label = 0;  // for signed labels, its bits
  std::function<mesh::Triangle(std::size_t)> at;
};

std::vector<FaceRun> faces_of(const mesh::Mesh& mesh);

// Each label's own surface, oriented outward: a wall occurs once for each of its labels.
std::vector<FaceRun> faces_of(const LabelledSurface& surface);

std::size_t count_of(const std::vector<FaceRun>& runs);

// True if the labels exceed signed 32-bit numbers; then none is negative.
bool has_wide_labels(const LabelledSurface& surface);

// Throws Error kTooLarge with the format's name if signed 32-bit numbers cannot count the vertices
// or the triangles' corners.
void check_signed_indices(std::size_t vertices, std::size_t triangles, MeshFormat format);

}  // namespace isomesh::codec
