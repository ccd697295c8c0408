// Corners of triangles and their opposites across edges. Private to this folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "server/mesh/mesh.h"

namespace isomesh::codec::edgebreaker {

// Corner i of face f is 4 f + i, i = 0, 1, 2: a face has four words in the table of opposite
// corners; the fourth repeats the first.
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

// triangles[face_of(corner)][index_of(corner)], whose byte offset is 12 * face + 4 * index = 3 *
// corner + index.
inline Vertex vertex_at(const mesh::Triangle* triangles, Corner corner) {
  Vertex vertex;
  std::memcpy(
      &vertex,
      reinterpret_cast<const std::byte*>(triangles) + 3 * std::size_t{corner} + index_of(corner),
      sizeof vertex);
  return vertex;
}

// A surface for the traversals: read only, shared by threads. The opposite of a corner is the
// corner across its edge in the adjacent face, or `none` at a boundary edge.
struct Connectivity {
  const std::uint32_t* words = nullptr;  // word 4 f + i: the corner opposite of corner next(i)
  const mesh::Triangle* triangles = nullptr;
  Face faces = 0;
  Vertex vertices = 0;
  Corner none = 0;  // 4 * faces; its own words are none too

  // The opposites of the next and of the previous corner: where edgebreaker continues from the
  // corner at the tip of a face.
  Corner right(Corner corner) const { return words[corner]; }
  Corner left(Corner corner) const { return words[corner + 1]; }
  Corner opposite(Corner corner) const { return words[previous(corner)]; }
  Vertex vertex(Corner corner) const { return vertex_at(triangles, corner); }
};

}  // namespace isomesh::codec::edgebreaker
