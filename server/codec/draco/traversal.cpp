#include "server/codec/draco/traversal.h"

#include <algorithm>
#include <cstring>
#include <unordered_map>

#include "server/codec/draco/look_ahead.h"
#include "server/codec/draco/prefetch.h"

namespace isomesh::codec::edgebreaker {

bool Traversal::run(const Fans& fans, Starts& starts, const mesh::Context& context) {
  for (Face face = 0; face < surface_.faces; ++face) {
    if (face_state_[face] != kLeft) continue;
    std::optional<Entrance> entrance = entrance_of(face, fans);
    if (!entrance) return false;
    const std::optional<Corner> end = choose_entrance(*entrance, fans);
    if (end) starts.put({*end, false});
    inner_first_faces_.push_back(entrance->inner.has_value());
    if (!entrance->inner) take_gate(entrance->corner);
    if (entrance->inner && !take_first(*entrance->inner)) return false;
    const std::uint32_t first_symbol = count_;
    if (!walk(entrance->corner, context)) return false;
    if (!end) {
      put_starts(first_symbol, starts);
    } else if (ends_.back() != *end) {
      return false;
    }
  }
  // Draco's decoder accepts at most four faces per three symbols, the ratio of a tetrahedron. Two
  // triangles back to back have one symbol.
  if (surface_.faces > count_ + count_ / 3) return false;
  resolve_events();
  return true;
}

void Traversal::prepare(const Connectivity& surface, const Fans& fans) {
  surface_ = surface;
  const std::size_t faces = surface.faces;
  std::memset(face_state_.resize_for_overwrite(faces + 1), kLeft, faces);
  face_state_[faces] = kGone;  // beyond the boundary
  std::memset(known_.resize_for_overwrite(surface.vertices), 0, surface.vertices);
  fans.for_each_on_boundary([&](Vertex vertex) { known_[vertex] = kRim; });
  symbols_.resize_for_overwrite(faces);
  waiting_.clear();
  all_splits_.clear();
  ends_.clear();
  events_.clear();
  inner_first_faces_.clear();
  rim_.clear();
  count_ = 0;
}

// The start of the traversal of the face's component. At a boundary edge of the face, that edge is
// the gate; otherwise the traversal starts behind the face. Empty if the boundary is unreachable,
// because its vertex has another fan, which is closed.
std::optional<Traversal::Entrance> Traversal::entrance_of(Face face, const Fans& fans) const {
  for (Corner corner = corner_of(face, 0); index_of(corner) < 3; ++corner) {
    if (surface_.opposite(corner) == surface_.none) return Entrance{corner, std::nullopt};
    if (!fans.on_boundary(surface_.vertex(corner))) continue;
    Corner at = corner;
    for (;;) {
      const Corner across = surface_.opposite(previous(at));
      if (across == surface_.none) return Entrance{previous(at), std::nullopt};
      at = previous(across);
      if (at == corner) return std::nullopt;
    }
  }
  return Entrance{surface_.opposite(corner_of(face, 1)), face};
}

// While many faces remain, searches an entrance to the same component with a predictable end of the
// traversal. Returns that end, or empty if the search was given up.
std::optional<Corner> Traversal::choose_entrance(Entrance& entrance, const Fans& fans) {
  constexpr int kMostLooks = 24;
  if (surface_.faces - count_ - inner_first_faces_.size() < least_to_look_ahead_) {
    return std::nullopt;
  }
  LookAhead look_ahead(surface_, face_state_.data(), known_.data());
  for (int looks = 0; looks < kMostLooks; ++looks) {
    const LookAhead::Seen seen = look_ahead.from(entrance.corner, entrance.inner);
    if (seen.end || seen.all) return seen.end;
    const std::optional<Entrance> other = entrance_of(seen.reached, fans);
    if (!other) return std::nullopt;
    entrance = *other;
  }
  return std::nullopt;
}

// Visits the first face of a component, if it is inside.
bool Traversal::take_first(Face face) {
  face_state_[face] = kGone;
  for (std::uint32_t i = 0; i < 3; ++i) {
    std::uint8_t& known = known_[surface_.vertex(corner_of(face, i))];
    if (known != 0) return false;
    known = kKnown;
  }
  return true;
}

// A component's first edge; its vertices need never be a tip.
void Traversal::take_gate(Corner corner) {
  for (const Corner end : {next(corner), previous(corner)}) {
    if (known_[surface_.vertex(end)] == kRim) take_rim(surface_.vertex(end));
  }
}

void Traversal::take_rim(Vertex vertex) {
  known_[vertex] = kKnown;
  rim_.push_back({vertex, components() - 1});
}

bool Traversal::walk(Corner corner, const mesh::Context& context) {
  constexpr std::uint32_t kSymbolsBetweenLooks = 1 << 18;
  // Local copies: the compiler assumes that byte stores may alias the members.
  const Connectivity surface = surface_;
  std::uint8_t* const state = face_state_.data();
  std::uint8_t* const known = known_.data();
  std::uint8_t* const symbols = symbols_.data();
  std::uint32_t n = count_;
  std::uint32_t look = n;
  NextRound next_round(surface);
  for (;;) {
    for (;;) {
      state[face_of(corner)] = kGone;
      const Corner right = surface.right(corner);
      const Vertex tip = surface.vertex(corner);
      const Corner left = surface.left(corner);
      if (known[tip] == 0) {
        known[tip] = kKnown;
        symbols[n++] = kC;
        next_round.passed(left);
        corner = right;
        continue;
      }
      if (known[tip] == kRim) [[unlikely]]
        take_rim(tip);
      const std::uint8_t right_state = state[face_of(right)];
      const std::uint8_t left_state = state[face_of(left)];
      symbols[n] =
          static_cast<std::uint8_t>(1 | (left_state & kGone) << 1 | (right_state & kGone) << 2);
      if (((right_state | left_state) & kSplit) != 0) [[unlikely]] {
        if ((right_state & kSplit) != 0) events_.push_back({n, face_of(right), 1});
        if ((left_state & kSplit) != 0) events_.push_back({n, face_of(left), 0});
      }
      if (right_state != kLeft) {
        if (left_state != kLeft) break;
        corner = left;
      } else if (left_state != kLeft) {
        corner = right;
      } else {
        if (!is_of_open_fan(corner)) return false;
        state[face_of(corner)] = kGone | kSplit;
        all_splits_.push_back({face_of(corner), n});
        waiting_.push_back(left);
        corner = right;
      }
      ++n;
    }
    ends_.push_back(corner);
    ++n;
    if (n >= look) {
      context.throw_if_stopped();
      look = n + kSymbolsBetweenLooks;
    }
    do {
      if (waiting_.empty()) {
        count_ = n;
        return true;
      }
      corner = waiting_.back();
      waiting_.pop_back();
    } while (state[face_of(corner)] != kLeft);
  }
}

// True if a visited face or the boundary is at the tip of a split. Otherwise this is the first face
// of a fan whose vertex is known from another fan.
bool Traversal::is_of_open_fan(Corner corner) const {
  Corner at = corner;
  for (;;) {
    const Corner right = surface_.right(at);
    if (right == surface_.none) return true;
    at = next(right);
    if (at == corner) return false;
    if (face_state_[face_of(at)] != kLeft) return true;
  }
}

// The decoder orders values from the last face, and again, backwards, from each face not reached by
// then. It reaches all from the last face, unless that face is attached by its gate alone. Then it
// reaches nothing else, and the previous one is next.
void Traversal::put_starts(std::uint32_t first_symbol, Starts& starts) {
  std::size_t end = ends_.size() - 1;
  Corner tip = ends_[end];
  for (std::uint32_t symbol = count_ - 1;; --symbol) {
    starts.put({tip, symbol + 1 < count_});
    if (symbol == first_symbol || !hangs_by_its_gate(tip)) return;
    face_state_[face_of(tip)] |= kListed;
    tip = tip_before(tip, symbol, end);
  }
}

// The tip of the preceding symbol: across the gate, unless that symbol is an E. Those are listed;
// `end` is the index of the last one used.
Corner Traversal::tip_before(Corner corner, std::uint32_t symbol, std::size_t& end) const {
  const std::uint8_t before = symbols_[symbol - 1];
  if (before == kE) return ends_[--end];
  const Corner across = surface_.opposite(corner);
  // After R the traversal turned left, otherwise right.
  return before == kR ? next(across) : previous(across);
}

// Events store splits by face until all splits are known. Each split has at most one event.
void Traversal::resolve_events() {
  std::unordered_map<Face, std::size_t> event_at;
  for (std::size_t i = 0; i < events_.size(); ++i) event_at.emplace(events_[i].split, i);
  if (event_at.empty()) return;
  for (const Split& split : all_splits_) {
    const auto found = event_at.find(split.face);
    if (found != event_at.end()) events_[found->second].split = split.symbol;
  }
}

bool Traversal::hangs_by_its_gate(Corner corner) const {
  const auto is_behind = [&](Corner side) {
    return side == surface_.none || (face_state_[face_of(side)] & kListed) != 0;
  };
  return is_behind(surface_.right(corner)) && is_behind(surface_.left(corner));
}

}  // namespace isomesh::codec::edgebreaker
