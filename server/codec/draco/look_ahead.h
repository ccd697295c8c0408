// Predicts the end of a traversal. Private to this folder.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "server/codec/draco/corners.h"

namespace isomesh::codec::edgebreaker {

// The decoder orders values from the end of a component's traversal, so the ordering would have to
// wait for it. But the branch that the first split postpones is visited last. If it is a closed
// pocket, its end is the end of the whole traversal. So a few thousand faces are traversed ahead
// until such a split is found, and then all marks are removed. Not thread safe.
class LookAhead {
 public:
  // The traversal's marks per face and vertex: 0, or nonzero if visited.
  LookAhead(const Connectivity& surface, std::uint8_t* faces, std::uint8_t* vertices)
      : surface_(surface), face_marks_(faces), vertex_marks_(vertices) {}

  struct Seen {
    std::optional<Corner> end;  // the corner at which the traversal will end, if known
    bool all = false;
    Face reached = 0;  // a face farther along
  };

  // Predicts a traversal that continues from this corner, after its `first` face, if it has one
  // inside.
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
  std::vector<Face> faces_;  // marked by this object
  std::vector<Vertex> vertices_;
  Face reached_ = 0;
  bool in_pocket_ = false;  // the end found is that of a pocket
};

}  // namespace isomesh::codec::edgebreaker
