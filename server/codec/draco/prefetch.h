// Prefetch hints. Private to this folder.
#pragma once

#include <array>

#include "server/codec/draco/corners.h"

namespace isomesh::codec::edgebreaker {

// A depth-first traversal turns right as long as it meets new vertices. The face on the left then
// belongs to its next round. Prefetches that face, and some steps later its neighbours.
class NextRound {
 public:
  explicit NextRound(const Connectivity& surface)
      : words_(surface.words), triangles_(reinterpret_cast<std::uintptr_t>(surface.triangles)) {}

  // `left` is the corner left of the present one.
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
    // For `none` the address lies behind the triangles. That is harmless: a prefetch does not read
    // it.
    __builtin_prefetch(
        reinterpret_cast<const void*>(triangles_ + sizeof(mesh::Triangle) * face_of(corner)));
  }

  const std::uint32_t* words_;
  std::uintptr_t triangles_;
  std::array<Corner, 8> earlier_ = {};
  std::size_t at_ = 0;
};

}  // namespace isomesh::codec::edgebreaker
