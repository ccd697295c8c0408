#include "server/codec/draco/value_order.h"

#include <cstring>

namespace isomesh::codec::edgebreaker {

void ValueOrder::prepare(const Connectivity& surface, const Fans& fans) {
  surface_ = surface;
  const std::size_t faces = surface.faces;
  std::memset(face_gone_.resize_for_overwrite(faces + 1), 0, faces);
  face_gone_[faces] = 1;  // beyond the boundary
  std::memset(vertex_state_.resize_for_overwrite(surface.vertices), 0, surface.vertices);
  fans.for_each_on_boundary([&](Vertex vertex) { vertex_state_[vertex] = kBoundary; });
  order_.resize_for_overwrite(surface.vertices);
  waiting_.clear();
  components_.clear();
  firsts_.clear();
  count_ = 0;
}

// True if all vertices of the face across the corner's edge have values.
bool ValueOrder::is_predicted(Corner corner) const {
  const Corner across = surface_.opposite(corner);
  if (across == surface_.none) return false;
  for (const Corner other : {across, next(across), previous(across)}) {
    if ((vertex_state_[surface_.vertex(other)] & kPlaced) == 0) return false;
  }
  return true;
}

// Appends the vertex unless it has a place.
void ValueOrder::put(Corner corner) {
  std::uint8_t& state = vertex_state_[surface_.vertex(corner)];
  if ((state & kPlaced) != 0) return;
  const bool is_first = !is_predicted(corner);
  state = static_cast<std::uint8_t>(state | kPlaced);
  if (is_first) firsts_.push_back(count_);
  order_[count_++] = corner | (is_first ? kFirstValue : 0);
}

}  // namespace isomesh::codec::edgebreaker
