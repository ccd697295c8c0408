// Edgebreaker: encodes a surface's connectivity face by face as symbols. Private to this folder.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "server/codec/draco/corners.h"
#include "server/codec/draco/fans.h"
#include "server/codec/draco/starts.h"
#include "server/mesh/buffer.h"
#include "server/mesh/context.h"

namespace isomesh::codec::edgebreaker {

// The position of a face relative to the visited ones, by its tip, the vertex opposite the edge of
// entry. C: the tip is new. Otherwise bits are set if the faces on the left and right of the tip
// are visited.
enum Symbol : std::uint8_t { kC = 0, kS = 1, kL = 3, kR = 5, kE = 7 };

// A face closes against its left (side 0) or right (side 1) neighbour, an S whose left side was
// postponed. Both are symbol numbers.
struct SplitEvent {
  std::uint32_t source = 0;
  std::uint32_t split = 0;
  std::uint8_t side = 0;
};

// Visits all faces depth-first: Rossignac's Edgebreaker in the form of Draco's bitstream. Keeps its
// memory between surfaces. Not thread safe.
class Traversal {
 public:
  // While at least this many faces remain, the entrance to a component is chosen so that the end of
  // its traversal is known.
  explicit Traversal(std::size_t least_to_look_ahead) : least_to_look_ahead_(least_to_look_ahead) {}

  void prepare(const Connectivity& surface, const Fans& fans);

  // Call once after prepare. Fills the results below and `starts`, which stays open. Returns false
  // if a vertex has a second closed fan, which Draco cannot represent, or if too many triangles lie
  // back to back for its decoder. Throws Error kCancelled.
  bool run(const Fans& fans, Starts& starts, const mesh::Context& context);

  std::span<const std::uint8_t> symbols() const { return {symbols_.data(), count_}; }
  const std::vector<SplitEvent>& events() const { return events_; }
  std::size_t splits() const { return all_splits_.size(); }
  // Per component: true if it starts with a face inside, which has no symbol.
  const std::vector<bool>& inner_first_faces() const { return inner_first_faces_; }

  std::uint32_t components() const { return static_cast<std::uint32_t>(inner_first_faces_.size()); }
  // A vertex on the boundary and its component.
  struct RimVertex {
    Vertex vertex = 0;
    std::uint32_t component = 0;
  };
  const std::vector<RimVertex>& rim() const { return rim_; }

 private:
  // States of a vertex: known to the decoder, or on the boundary and therefore treated as known.
  static constexpr std::uint8_t kKnown = 1;
  static constexpr std::uint8_t kRim = 2;

  // States of a face, cumulative: visited, a split, checked for a start.
  enum FaceState : std::uint8_t { kLeft = 0, kGone = 1, kSplit = 2, kListed = 4 };

  // A face with symbol S, and the number of its symbol.
  struct Split {
    Face face = 0;
    std::uint32_t symbol = 0;
  };
  struct Entrance {
    Corner corner = 0;
    std::optional<Face> inner;  // the component's first face if it is inside, without a symbol
  };

  std::optional<Entrance> entrance_of(Face face, const Fans& fans) const;
  std::optional<Corner> choose_entrance(Entrance& entrance, const Fans& fans);
  bool take_first(Face face);
  void take_gate(Corner corner);
  void take_rim(Vertex vertex);
  bool walk(Corner corner, const mesh::Context& context);
  bool is_of_open_fan(Corner corner) const;
  Corner tip_before(Corner corner, std::uint32_t symbol, std::size_t& end) const;
  void resolve_events();
  void put_starts(std::uint32_t first_symbol, Starts& starts);
  bool hangs_by_its_gate(Corner corner) const;

  const std::size_t least_to_look_ahead_;
  Connectivity surface_;
  mesh::Buffer<std::uint8_t> face_state_;
  mesh::Buffer<std::uint8_t> known_;  // per vertex: 0, kKnown or kRim
  mesh::Buffer<std::uint8_t> symbols_;
  std::vector<Corner> waiting_;  // the left sides of splits
  std::vector<Split> all_splits_;
  std::vector<Corner> ends_;  // the tips of the E symbols
  std::vector<SplitEvent> events_;
  std::vector<bool> inner_first_faces_;
  std::vector<RimVertex> rim_;
  std::uint32_t count_ = 0;
};

}  // namespace isomesh::codec::edgebreaker
