// Where a traversal will end, before it has begun; private to this folder.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "server/codec/draco/corners.h"

namespace isomesh::codec::edgebreaker {

// The decoder orders values from where the traversal of a component ended, so whoever makes that
// order would have to wait. But what the first split leaves aside is come to last, and if that is a
// pocket that ends by itself, its end is the whole traversal's. So some thousand faces are walked
// through ahead, until there is such a split, and then everything is taken back. Not thread safe.
class LookAhead {
 public:
  // The marks of the traversal: for each face and each vertex 0, or not where it was there.
  LookAhead(const Connectivity& surface, std::uint8_t* faces, std::uint8_t* vertices)
      : surface_(surface), face_marks_(faces), vertex_marks_(vertices) {}

  struct Seen {
    std::optional<Corner> end;  // the corner at which the traversal will end, if that is known
    bool all = false;           // what there is was walked through
    Face reached = 0;           // a face farther on
  };

  // What a traversal will do that goes on from this corner, with its first face, if it has one
  // inside, done.
  Seen from(Corner corner, std::optional<Face> first);

 private:
  template <class EndsAt>
  std::optional<Corner> walk(Corner corner, std::size_t most, EndsAt ends_at);
  std::optional<Corner> end_of_pocket(Corner left, Corner right);
  void take(Face face);
  void take_vertex(Vertex vertex);
  void take_back(std::size_t faces, std::size_t vertices);

  const Connectivity& surface_;
  std::uint8_t* face_marks_;
  std::uint8_t* vertex_marks_;
  std::vector<Face> faces_;  // marked here
  std::vector<Vertex> vertices_;
  Face reached_ = 0;
  bool in_pocket_ = false;  // the end that was found is a pocket's
};

}  // namespace isomesh::codec::edgebreaker
