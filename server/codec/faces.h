// The triangles of a file, one after the other, whether it is of one surface or of labels; private
// to this folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "server/codec/encode_labels.h"
#include "server/mesh/mesh.h"

namespace isomesh::codec {

// Triangles of one label. `at` may be called from several threads; what it was made of has to
// outlive it.
struct FaceRun {
  std::size_t count = 0;
  std::uint32_t label = 0;  // or of a signed one the bits
  std::function<mesh::Triangle(std::size_t)> at;
};

std::vector<FaceRun> faces_of(const mesh::Mesh& mesh);

// Of every label its own surface, turned outward: a wall is there for each that it belongs to.
std::vector<FaceRun> faces_of(const LabelledSurface& surface);

std::size_t count_of(const std::vector<FaceRun>& runs);

// Whether the labels are too large for signed numbers of 32 bits; then none is negative.
bool has_wide_labels(const LabelledSurface& surface);

// Formats whose indices are signed numbers of 32 bits hold so many vertices, and so many corners.
// Throws Error kTooLarge with the format's name where there are more.
void check_signed_indices(std::size_t vertices, std::size_t triangles, MeshFormat format);

}  // namespace isomesh::codec
