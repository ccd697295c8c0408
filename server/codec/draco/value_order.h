// The order of vertex values in the decoder. Private to this folder.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "server/codec/draco/corners.h"
#include "server/codec/draco/fans.h"
#include "server/codec/draco/prefetch.h"
#include "server/codec/draco/starts.h"
#include "server/mesh/buffer.h"

namespace isomesh::codec::edgebreaker {

// A value is identified by the corner at which the order reaches its vertex. The face across that
// corner's edge predicts the value. Without such a face the value is a first value.
inline constexpr std::uint32_t kFirstValue = 1U << 31;

// A component's values, as a range of the order. The stream has components from last to first.
struct ValueRange {
  std::uint32_t begin = 0;
  std::uint32_t end = 0;
};

// Draco's depth-first traversal of vertices. Keeps its memory between surfaces. Not thread safe,
// except where noted.
class ValueOrder {
 public:
  void prepare(const Connectivity& surface, const Fans& fans);

  // Continues from a start. Calls more(count) after every few values, so that they are processed
  // while they are in the first-level cache.
  template <class More>
  void add(Start start, More more);

  // The corners, some with kFirstValue. Another thread may read the corners before a count that it
  // received through more().
  const std::uint32_t* corners() const { return order_.data(); }
  std::uint32_t count() const { return count_; }
  const std::vector<ValueRange>& components() const { return components_; }
  // The positions of first values in the order, ascending.
  const std::vector<std::uint32_t>& firsts() const { return firsts_; }

 private:
  static constexpr std::uint32_t kValuesAtOnce = 256;

  // Flags of a vertex: it has its place in the order; it is on the boundary.
  enum VertexState : std::uint8_t { kPlaced = 1, kBoundary = 2 };

  bool is_predicted(Corner corner) const;
  void put(Corner corner);

  Connectivity surface_;
  mesh::Buffer<std::uint8_t> face_gone_;
  mesh::Buffer<std::uint8_t> vertex_state_;
  mesh::Buffer<std::uint32_t> order_;
  std::vector<Corner> waiting_;
  std::vector<ValueRange> components_;
  std::vector<std::uint32_t> firsts_;
  std::uint32_t count_ = 0;
};

template <class More>
void ValueOrder::add(Start start, More more) {
  std::uint32_t told = count_;
  if (!start.continues) components_.push_back({count_, count_});
  if (face_gone_[face_of(start.corner)] != 0) return;
  for (const Corner tip : {next(start.corner), previous(start.corner), start.corner}) put(tip);

  const Connectivity surface = surface_;
  std::uint8_t* const gone = face_gone_.data();
  std::uint8_t* const vertices = vertex_state_.data();
  std::uint32_t* const order = order_.data();
  std::uint32_t n = count_;
  NextRound next_round(surface);
  Corner corner = start.corner;
  for (;;) {
    for (;;) {
      gone[face_of(corner)] = 1;
      const Corner right = surface.right(corner);
      const Vertex tip = surface.vertex(corner);
      const std::uint8_t state = vertices[tip];
      const Corner left = surface.left(corner);
      if ((state & kPlaced) == 0) {
        vertices[tip] = static_cast<std::uint8_t>(state | kPlaced);
        order[n++] = corner;
        if (n - told >= kValuesAtOnce) [[unlikely]] {
          more(n);
          told = n;
        }
        if (state == 0) {
          next_round.passed(left);
          corner = right;
          continue;
        }
      }
      if (gone[face_of(right)] != 0) {
        if (gone[face_of(left)] != 0) break;
        corner = left;
      } else {
        if (gone[face_of(left)] == 0) waiting_.push_back(left);
        corner = right;
      }
    }
    do {
      if (waiting_.empty()) {
        count_ = n;
        components_.back().end = n;
        if (n != told) more(n);
        return;
      }
      corner = waiting_.back();
      waiting_.pop_back();
    } while (gone[face_of(corner)] != 0);
  }
}

}  // namespace isomesh::codec::edgebreaker
