// Hints for what memory comes next; private to this folder.
#pragma once

#include <array>

#include "server/codec/draco/corners.h"

namespace isomesh::codec::edgebreaker {

// A depth-first walk turns right for as long as it meets new vertices: the face left of it is one
// of the walk's next round. That face, and some steps later its own neighbours, are asked for
// ahead.
class NextRound {
 public:
  explicit NextRound(const Connectivity& surface)
      : words_(surface.words), triangles_(reinterpret_cast<std::uintptr_t>(surface.triangles)) {}

  // `left` is the corner left of where the walk is.
  void passed(Corner left) {
    fetch(left);
    const Corner earlier = earlier_[at_];
    earlier_[at_] = left;
    at_ = (at_ + 1) % earlier_.size();
    fetch(words_[earlier]);
    fetch(words_[earlier + 1]);
  }

 private:
  void fetch(Corner corner) const {
    __builtin_prefetch(words_ + (corner & ~3U));
    // At `none` that is an address behind the triangles, which is no matter: it is not read.
    __builtin_prefetch(
        reinterpret_cast<const void*>(triangles_ + sizeof(mesh::Triangle) * face_of(corner)));
  }

  const std::uint32_t* words_;
  std::uintptr_t triangles_;
  std::array<Corner, 8> earlier_ = {};
  std::size_t at_ = 0;
};

}  // namespace isomesh::codec::edgebreaker
