#include "server/mesh/extract/links.h"

#include <algorithm>
#include <bit>
#include <tuple>

#include "server/mesh/lattice/bcc_faces.h"
#include "server/mesh/lattice/tetrahedra.h"
#include "server/mesh/points.h"

namespace isomesh::mesh {
namespace {

using Step = std::array<int, 3>;

Step position(unsigned corner) {
  return {static_cast<int>(corner & 1), static_cast<int>(corner >> 1 & 1),
          static_cast<int>(corner >> 2)};
}

bool is_later(const Step& step) {
  return std::tuple(step[2], step[1], step[0]) > std::tuple(0, 0, 0);
}

std::size_t axes_of(const Step& step) {
  return 3 - static_cast<std::size_t>(std::ranges::count(step, 0));
}

Directions bit(std::size_t direction) { return Directions{1} << direction; }

// The directions of `set` that can be reached from its lowest one.
Directions component_of(const std::array<Directions, kMostDirections>& adjacent, Directions set) {
  Directions reached = set & (~set + 1);
  for (Directions before = 0; reached != before;) {
    before = reached;
    for (Directions rest = before; rest != 0; rest &= rest - 1) {
      reached |= adjacent[static_cast<std::size_t>(std::countr_zero(rest))] & set;
    }
  }
  return reached;
}

// Sets of places of a ring, one bit each set.
struct PlaceSets {
  std::uint64_t runs = 0;   // none, or one run that leaves two places free
  std::uint64_t risky = 0;  // those with a subset that is no such run
};

constexpr PlaceSets make_place_sets(unsigned size) {
  PlaceSets sets;
  for (unsigned bits = 0; bits < 1U << size; ++bits) {
    const unsigned next = (bits >> 1 | bits << (size - 1)) & ((1U << size) - 1);
    const bool is_run =
        std::popcount(bits & ~next) <= 1 && static_cast<unsigned>(std::popcount(bits)) + 2 <= size;
    if (is_run) sets.runs |= std::uint64_t{1} << bits;
  }
  for (unsigned bits = 0; bits < 1U << size; ++bits) {
    for (unsigned some = bits; some != 0; some = (some - 1) & bits) {
      if ((sets.runs >> some & 1) == 0) sets.risky |= std::uint64_t{1} << bits;
    }
  }
  return sets;
}

const PlaceSets& place_sets(std::size_t size) {
  static constexpr PlaceSets kOfFour = make_place_sets(4);
  static constexpr PlaceSets kOfSix = make_place_sets(6);
  return size == 4 ? kOfFour : kOfSix;
}

}  // namespace

Links::Links(Scheme scheme) {
  add_directions(scheme);
  sort_directions();
  const auto has = [&](unsigned parity, const Step& step) {
    return find(step) >= 0 && (scheme == Scheme::kSix || parity == 0 || axes_of(step) == 1);
  };
  links_.push_back(make_link(0, 1, has));
  if (scheme == Scheme::kFive) links_.push_back(make_link(1, 1, has));
}

// A tetrahedron belongs to the layer of the lower of its two centres: that of a sample's is half a
// cell below it, that of a centre's a whole one.
Links::Links(BccPoint point) {
  add_directions(point);
  sort_directions();
  const auto has = [&](unsigned /*parity*/, const Step& step) { return find(step) >= 0; };
  links_.push_back(make_link(0, point == BccPoint::kSample ? 1 : 2, has));
}

// From the owners' edges to those of the samples at their ends.
void Links::add_directions(Scheme scheme) {
  for (const bool odd : {false, true}) {
    const CellSplit& split = cell_split(scheme, odd);
    for (std::uint8_t place = 1; place < 8; ++place) {
      const auto [from, to] = split.ends[place];
      if (from == to) continue;
      for (const LinkDirection& direction :
           {LinkDirection{minus(position(to), position(from)), from, place, false},
            LinkDirection{minus(position(from), position(to)), to, place, true}}) {
        if (std::ranges::find(directions_, direction) == directions_.end()) {
          directions_.push_back(direction);
        }
      }
    }
  }
}

void Links::add_directions(BccPoint point) {
  const bool is_centre = point == BccPoint::kCentre;
  for (std::uint8_t corner = 0; corner < 8; ++corner) {
    Step to_corner;  // from the centre
    for (std::size_t axis = 0; axis < 3; ++axis) {
      to_corner[axis] = 2 * position(corner)[axis] - 1;
    }
    directions_.push_back(is_centre
                              ? LinkDirection{to_corner, 0, corner, false}
                              : LinkDirection{minus(Step{}, to_corner), corner, corner, true});
  }
  for (unsigned axis = 0; axis < 3; ++axis) {
    Step step = {0, 0, 0};
    step[axis] = 2;
    const auto corner = static_cast<std::uint8_t>(1U << axis);
    const auto slot = static_cast<std::uint8_t>((is_centre ? kBccCentreSlot : kBccAxisSlot) + axis);
    directions_.push_back({step, 0, slot, false});
    directions_.push_back({minus(Step{}, step), corner, slot, true});
  }
}

void Links::sort_directions() {
  // Along the axes first, so that sets of those alone are small numbers.
  const auto rank = [](const LinkDirection& direction) {
    Step step = direction.step;
    const bool later = is_later(step);
    if (!later) step = minus(Step{}, step);
    return std::tuple(!later, axes_of(step), step);
  };
  std::ranges::sort(directions_, {}, rank);
  for (std::size_t d = 0; d < directions_.size(); ++d) {
    if ((directions_[d].corner >> 2) != 0) below_ |= bit(d);
  }
}

int Links::find(const Step& step) const {
  const auto found = std::ranges::find(directions_, step, &LinkDirection::step);
  return found == directions_.end() ? -1 : static_cast<int>(found - directions_.begin());
}

template <class Has>
Links::Link Links::make_link(unsigned parity, int below, Has has) const {
  Link link;
  const auto parity_at = [&](const Step& step) {
    return (parity + static_cast<unsigned>(step[0] + step[1] + step[2])) & 1;
  };
  for (std::size_t d = 0; d < directions_.size(); ++d) {
    if (has(parity, directions_[d].step)) link.existing |= bit(d);
  }
  for (std::size_t a = 0; a < directions_.size(); ++a) {
    const Step& to = directions_[a].step;
    for (std::size_t b = 0; b < directions_.size(); ++b) {
      if ((link.existing >> a & link.existing >> b & 1) == 0) continue;
      if (has(parity_at(to), minus(directions_[b].step, to))) link.adjacent[a] |= bit(b);
    }
  }
  for (std::size_t a = 0; a < directions_.size(); ++a) {
    if ((link.existing >> a & 1) != 0) link.rings[a] = make_ring(link, a);
    if (a >= half()) link.ring_sets[a - half()] = make_ring_sets(link.rings[a]);
    for (std::size_t b = a + 1; b < directions_.size(); ++b) {
      for (std::size_t c = b + 1; c < directions_.size(); ++c) {
        if ((link.adjacent[a] >> b & link.adjacent[a] >> c & link.adjacent[b] >> c & 1) != 0) {
          bool is_below = false;
          for (const std::size_t d : {a, b, c}) is_below |= directions_[d].step[2] <= -below;
          (is_below ? link.below : link.above).push_back(bit(a) | bit(b) | bit(c));
        }
      }
    }
  }
  link.known = std::make_unique<std::atomic<ClusterFacts>[]>(std::bit_ceil(link.existing));
  return link;
}

Links::Ring Links::make_ring(const Link& link, std::size_t direction) const {
  Ring ring;
  for (Directions rest = link.adjacent[direction]; rest != 0;) {
    const Directions next = ring.size == 0 ? rest : rest & link.adjacent[ring.mine[ring.size - 1]];
    const auto place = static_cast<std::size_t>(std::countr_zero(next));
    ring.mine[ring.size] = static_cast<std::uint8_t>(place);
    ring.theirs[ring.size] = static_cast<std::uint8_t>(
        find(minus(directions_[place].step, directions_[direction].step)));
    ++ring.size;
    rest &= ~bit(place);
  }
  return ring;
}

Links::RingSets Links::make_ring_sets(const Ring& ring) {
  RingSets sets;
  sets.runs = place_sets(ring.size).runs;
  sets.risky = place_sets(ring.size).risky;
  const auto make = [&](const std::array<std::uint8_t, 6>& directions) {
    std::array<std::uint8_t, std::size_t{2}* OnRing::kHalf> places = {};
    for (std::size_t i = 0; i < ring.size; ++i) {
      places[directions[i]] = static_cast<std::uint8_t>(1U << i);
    }
    OnRing on_ring;
    for (std::size_t half = 0; half < 2; ++half) {
      auto& sets_of_half = on_ring.halves[half];
      for (std::size_t set = 1; set < sets_of_half.size(); ++set) {
        const auto lowest = static_cast<std::size_t>(std::countr_zero(set));
        const std::uint8_t place = places[half * OnRing::kHalf + lowest];
        sets_of_half[set] = static_cast<std::uint8_t>(sets_of_half[set & (set - 1)] | place);
      }
    }
    return on_ring;
  };
  sets.mine = make(ring.mine);
  sets.theirs = make(ring.theirs);
  return sets;
}

ClusterFacts Links::find_facts(const Link& link, Directions set) const {
  const auto on_ring = [&](const Ring& ring) {
    unsigned bits = 0;
    for (std::size_t i = 0; i < ring.size; ++i) bits |= (set >> ring.mine[i] & 1) << i;
    return bits;
  };
  ClusterFacts::Parts parts;
  parts.first = component_of(link.adjacent, set);
  for (Directions rest = set; rest != 0; ++parts.components) {
    rest &= ~component_of(link.adjacent, rest);
  }
  const Directions free = link.existing & ~set;
  parts.may_join = free != 0 && component_of(link.adjacent, free) == free;
  for (std::size_t d = 0; d < directions_.size(); ++d) {
    if ((link.existing >> d & 1) == 0) continue;
    const Ring& ring = link.rings[d];
    const unsigned bits = on_ring(ring);
    const PlaceSets& sets = place_sets(ring.size);
    if ((free >> d & 1) != 0 && (sets.runs >> bits & 1) == 0) parts.forbidden |= bit(d);
    if (d >= half() && (sets.risky >> bits & 1) != 0) parts.risks |= bit(d - half());
  }
  const auto count_lost = [&](const std::vector<Directions>& triangles) {
    const auto is_lost = [&](Directions corners) {
      return ((corners & set) & ((corners & set) - 1)) != 0;  // two of them, or all
    };
    return static_cast<unsigned>(std::ranges::count_if(triangles, is_lost));
  };
  parts.lost_above = count_lost(link.above);
  parts.lost_below = count_lost(link.below);
  return ClusterFacts(parts);
}

Directions Links::find_clashing(unsigned parity, std::size_t direction, Directions mine,
                                Directions theirs) const {
  const auto& step = directions_[direction].step;
  const unsigned there = (parity + static_cast<unsigned>(step[0] + step[1] + step[2])) & 1;
  Directions found = 0;
  for (Directions rest = mine; rest != 0;) {
    const Directions one = facts(parity, rest).first();
    rest &= ~one;
    for (Directions others = theirs; others != 0;) {
      const Directions other = facts(there, others).first();
      others &= ~other;
      if (clash(parity, direction, one, other)) found |= one;
    }
  }
  return found;
}

const Links& links_of(Scheme scheme) {
  static const Links six(Scheme::kSix);
  static const Links five(Scheme::kFive);
  return scheme == Scheme::kSix ? six : five;
}

const Links& links_of(BccPoint point) {
  static const Links samples(BccPoint::kSample);
  static const Links centres(BccPoint::kCentre);
  return point == BccPoint::kSample ? samples : centres;
}

}  // namespace isomesh::mesh
