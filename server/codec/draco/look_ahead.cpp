#include "server/codec/draco/look_ahead.h"

namespace isomesh::codec::edgebreaker {
namespace {

constexpr std::size_t kMostAhead = 4096;
constexpr std::size_t kMostOfPocket = 512;

}  // namespace

LookAhead::Seen LookAhead::from(Corner corner, std::optional<Face> first) {
  if (first) {
    take(*first);
    for (std::uint32_t i = 0; i < 3; ++i) take_vertex(surface_.vertex(corner_of(*first, i)));
  }
  in_pocket_ = false;
  const std::optional<Corner> end = walk(corner, kMostAhead, [&](Corner left, Corner right) {
    const std::optional<Corner> pocket = end_of_pocket(left, right);
    in_pocket_ = pocket.has_value();
    return pocket;
  });
  take_back(0, 0);
  return {in_pocket_ ? end : std::nullopt, end && !in_pocket_, reached_};
}

// Traverses at most `most` faces in the encoder's order. Ends early with the result of
// ends_at(left, right) at the first split.
template <class EndsAt>
std::optional<Corner> LookAhead::walk(Corner corner, std::size_t most, EndsAt ends_at) {
  const std::size_t most_faces = faces_.size() + most;
  std::vector<Corner> waiting;
  for (;;) {
    for (;;) {
      if (faces_.size() >= most_faces) {
        reached_ = face_of(corner);
        return std::nullopt;
      }
      take(face_of(corner));
      const Corner right = surface_.right(corner);
      const Corner left = surface_.left(corner);
      const Vertex tip = surface_.vertex(corner);
      if (vertex_marks_[tip] == 0) {
        take_vertex(tip);
        corner = right;
        continue;
      }
      const bool right_gone = face_marks_[face_of(right)] != 0;
      const bool left_gone = face_marks_[face_of(left)] != 0;
      if (right_gone && left_gone) break;
      if (!right_gone && !left_gone) {
        if (waiting.empty()) {
          if (const std::optional<Corner> end = ends_at(left, right)) return end;
        }
        waiting.push_back(left);
      }
      corner = right_gone ? left : right;
    }
    const Corner last = corner;
    do {
      if (waiting.empty()) return last;
      corner = waiting.back();
      waiting.pop_back();
    } while (face_marks_[face_of(corner)] != 0);
  }
}

// The end of a traversal that visits the left side of a split before the right one. Empty if it is
// too long, reaches the right side another way, or ends at a face that is attached by its gate
// alone.
std::optional<Corner> LookAhead::end_of_pocket(Corner left, Corner right) {
  const std::size_t faces = faces_.size();
  const std::size_t vertices = vertices_.size();
  const Face reached = reached_;
  std::optional<Corner> end =
      walk(left, kMostOfPocket, [](Corner, Corner) { return std::optional<Corner>(); });
  reached_ = reached;
  if (end && (face_marks_[face_of(right)] != 0 ||
              (surface_.right(*end) == surface_.none && surface_.left(*end) == surface_.none))) {
    end.reset();
  }
  take_back(faces, vertices);
  return end;
}

void LookAhead::take(Face face) {
  face_marks_[face] = 1;
  faces_.push_back(face);
}

void LookAhead::take_vertex(Vertex vertex) {
  if (vertex_marks_[vertex] != 0) return;
  vertex_marks_[vertex] = 1;
  vertices_.push_back(vertex);
}

// Removes the marks of all but the first `faces` and `vertices`.
void LookAhead::take_back(std::size_t faces, std::size_t vertices) {
  for (; faces_.size() > faces; faces_.pop_back()) face_marks_[faces_.back()] = 0;
  for (; vertices_.size() > vertices; vertices_.pop_back()) vertex_marks_[vertices_.back()] = 0;
}

}  // namespace isomesh::codec::edgebreaker
