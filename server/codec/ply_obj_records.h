// Records of file formats, for one surface and for labels. Private to this folder. Each function
// writes one record at `out`, which must have room for it, and returns its end.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "server/codec/encode.h"
#include "server/codec/number_text.h"
#include "server/codec/space.h"
#include "server/mesh/mesh.h"

namespace isomesh::codec {

// Up to and including "end_header". `of_faces`: lines of further face properties.
std::string ply_header(const Frame& frame, std::size_t vertices, std::size_t faces,
                       std::string_view of_faces);

inline constexpr std::size_t kPlyVertexBytes = sizeof(mesh::Vec3);
inline constexpr std::size_t kPlyFaceBytes = 1 + sizeof(mesh::Triangle);  // without properties
std::byte* write_ply_vertex(const mesh::Vec3& position, std::byte* out);
std::byte* write_ply_face(const mesh::Triangle& triangle, std::byte* out);

std::string obj_header(const Frame& frame);
inline constexpr std::size_t kMostObjVertexBytes = 2 + 3 * (1 + kMostFloatBytes);
inline constexpr std::size_t kMostObjFaceBytes = 2 + 3 * (1 + kMostIndexBytes);
std::byte* write_obj_vertex(const mesh::Vec3& position, std::byte* out);
std::byte* write_obj_face(const mesh::Triangle& triangle, std::byte* out);

}  // namespace isomesh::codec
