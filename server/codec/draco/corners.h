// How the encoder names the corners of triangles and what lies across their edges; private to this
// folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "server/mesh/mesh.h"

namespace isomesh::codec::edgebreaker {

// Corner i of face f is 4 f + i, i = 0, 1, 2: a face has four words in the table of opposite
// corners, and the fourth repeats the first.
using Corner = std::uint32_t;
using Face = std::uint32_t;
using Vertex = std::uint32_t;

inline constexpr std::uint32_t kWordsPerFace = 4;

// Corners leave the highest bit free for flags.
inline constexpr std::size_t kMostFaces = std::size_t{1} << 28;

constexpr Corner corner_of(Face face, std::uint32_t index) { return kWordsPerFace * face + index; }
constexpr Face face_of(Corner corner) { return corner / kWordsPerFace; }
constexpr std::uint32_t index_of(Corner corner) { return corner % kWordsPerFace; }

// The other corners of the face, counter-clockwise: 0 -> 1 -> 2 -> 0. The shifts look up 1, 2, 0
// and 2, 0, 1.
constexpr Corner next(Corner corner) {
  return (corner & ~3U) | ((0b001001U >> (index_of(corner) * 2)) & 3U);
}
constexpr Corner previous(Corner corner) {
  return (corner & ~3U) | ((0b010010U >> (index_of(corner) * 2)) & 3U);
}

// The vertex at a corner of these triangles: triangles[face_of(corner)][index_of(corner)], whose
// address is 12 * face + 4 * index = 3 * corner + index bytes on.
inline Vertex vertex_at(const mesh::Triangle* triangles, Corner corner) {
  Vertex vertex;
  std::memcpy(
      &vertex,
      reinterpret_cast<const std::byte*>(triangles) + 3 * std::size_t{corner} + index_of(corner),
      sizeof vertex);
  return vertex;
}

// A surface as the traversals see it: read only, shared by threads. Opposite of a corner is the
// corner across its edge, in the face on the other side, or `none` where the edge is the
// boundary's.
struct Connectivity {
  const std::uint32_t* words = nullptr;  // word 4 f + i: the corner opposite of corner next(i)
  const mesh::Triangle* triangles = nullptr;
  Face faces = 0;
  Vertex vertices = 0;
  Corner none = 0;  // 4 * faces; its own words say none

  // Opposite of the next corner of the face, and of the previous one: where edgebreaker goes on,
  // seen from the corner at the tip of a face.
  Corner right(Corner corner) const { return words[corner]; }
  Corner left(Corner corner) const { return words[corner + 1]; }
  Corner opposite(Corner corner) const { return words[previous(corner)]; }
  Vertex vertex(Corner corner) const { return vertex_at(triangles, corner); }
};

}  // namespace isomesh::codec::edgebreaker
