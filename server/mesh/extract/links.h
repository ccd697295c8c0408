// The rule for which crossings around a sample may be joined into one vertex (G. M. Treece, R. W.
// Prager, A. H. Gee, "Regularised marching tetrahedra", Computers & Graphics 23(4), 1999). It looks
// only at one sample and its neighbours; private to the kernels.
//
// The neighbours of a sample form its link, a triangulated sphere. A crossing belongs to the end of
// its edge whose value is nearer to the iso-value. So each sample has a set of directions with
// crossings of its own. A connected component C of that set becomes one vertex if
//  * C is not the whole link, and the rest of the link is connected;
//  * for every crossed direction p outside C: on the ring of p (the neighbours of both p and the
//    sample), C is empty, or one run that leaves at least two places free;
//  * for every neighbour on the same side that has such a component E: on the ring of that
//    neighbour, the intersection of C and E is empty, or one run that leaves at least two places
//    free. Otherwise the later of the two samples loses its component, whatever becomes of the
//    other.
// Under the first two conditions, the patches of the crossings form a disk that touches no patch
// around it twice. Under the third, the same holds for two adjacent disks. So the joined surface
// keeps the components, the boundary and the genus of the original one.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "proto/types.h"

namespace isomesh::mesh {

// A set of directions from a sample to its neighbours; bit d: direction d of Links::directions().
using Directions = std::uint32_t;

inline constexpr std::size_t kMostDirections = 18;

// The edge from a sample to a neighbour.
struct LinkDirection {
  std::array<int, 3> step = {0, 0, 0};  // in cells; on the body-centred lattice in half cells
  // Its name in tetrahedra.h: which corner the sample is of the cell of the edge's owner, and the
  // edge's direction there. `is_end`: the sample is the second of the edge's ends. On the
  // body-centred lattice that of the record and the slot in bcc_faces.h.
  std::uint8_t corner = 0;
  std::uint8_t place = 0;
  bool is_end = false;

  bool operator==(const LinkDirection&) const = default;
};

// The result of the rule for a set of directions around a sample.
class ClusterFacts {
 public:
  struct Parts {
    Directions first = 0;
    Directions forbidden = 0;
    Directions risks = 0;
    unsigned components = 0;
    unsigned lost_above = 0;
    unsigned lost_below = 0;
    bool may_join = false;
  };

  ClusterFacts() = default;
  explicit ClusterFacts(const Parts& parts)
      : bits_(std::uint64_t{1} << 63 | std::uint64_t{parts.may_join} << 61 |
              std::uint64_t{parts.lost_below} << 55 | std::uint64_t{parts.lost_above} << 49 |
              std::uint64_t{parts.components} << 45 | std::uint64_t{parts.risks} << 36 |
              std::uint64_t{parts.forbidden} << 18 | parts.first) {}

  bool is_known() const { return bits_ != 0; }
  // The component of the lowest direction.
  Directions first() const { return field(0, 18); }
  unsigned components() const { return field(45, 4); }
  // Triangles that vanish from the cells of the sample's layer and of the one below when each
  // component is one vertex.
  unsigned lost_above() const { return field(49, 6); }
  unsigned lost_below() const { return field(55, 6); }
  // Bit i: whether the components may clash with those of the neighbour in the earlier direction i.
  Directions risks() const { return field(36, 9); }

  // For a set of one component: true if it may become a vertex when no direction in `forbidden` is
  // crossed.
  bool may_join() const { return field(61, 1) != 0; }
  Directions forbidden() const { return field(18, 18); }

 private:
  Directions field(unsigned begin, unsigned count) const {
    return static_cast<Directions>(bits_ >> begin) & ((Directions{1} << count) - 1);
  }

  std::uint64_t bits_ = 0;
};

// The points of the body-centred lattice.
enum class BccPoint : std::uint8_t { kSample, kCentre };

// The links of one scheme's samples, or of one kind of points. Safe to use from several threads.
class Links {
 public:
  explicit Links(Scheme scheme);
  explicit Links(BccPoint point);

  // All that a sample can have: first those to samples that come later in x-fastest order, then
  // their opposites in the same order. With five tetrahedra, samples of odd i+j+k have those along
  // one axis only.
  std::span<const LinkDirection> directions() const { return directions_; }
  std::size_t half() const { return directions_.size() / 2; }
  // Those whose edges samples of the plane below own.
  Directions below() const { return below_; }

  // `set`: not empty, of existing directions. Found once and then remembered.
  ClusterFacts facts(unsigned parity, Directions set) const {
    const Link& link = link_of(parity);
    std::atomic<ClusterFacts>& known = link.known[set];
    ClusterFacts facts = known.load(std::memory_order_relaxed);
    if (!facts.is_known()) {
      facts = find_facts(link, set);
      known.store(facts, std::memory_order_relaxed);
    }
    return facts;
  }

  // True if components `mine` of a sample clash with `theirs` of its neighbour in an earlier
  // direction.
  bool clash(unsigned parity, std::size_t direction, Directions mine, Directions theirs) const {
    const RingSets& ring = link_of(parity).ring_sets[direction - half()];
    return (ring.runs >> ring.both(mine, theirs) & 1) == 0;
  }

  // Those of the components in `mine` of a sample that clash with one in `theirs` of its neighbour
  // in an earlier direction.
  Directions clashing(unsigned parity, std::size_t direction, Directions mine,
                      Directions theirs) const {
    const RingSets& ring = link_of(parity).ring_sets[direction - half()];
    const bool may_clash = (ring.risky >> ring.both(mine, theirs) & 1) != 0;
    return may_clash ? find_clashing(parity, direction, mine, theirs) : 0;
  }

  // The directions to both a sample and one of its neighbours, in cyclic order: as the sample and
  // as the neighbour number them.
  struct Ring {
    std::size_t size = 0;
    std::array<std::uint8_t, 6> mine = {};
    std::array<std::uint8_t, 6> theirs = {};
  };

  const Ring& ring(unsigned parity, std::size_t direction) const {
    return link_of(parity).rings[direction];
  }

  // The triangles of a sample's link, three directions each, one for each tetrahedron around the
  // sample: of those in its own layer, and in the layer below.
  std::span<const Directions> above(unsigned parity) const { return link_of(parity).above; }
  std::span<const Directions> below(unsigned parity) const { return link_of(parity).below; }

 private:
  // Maps a set of directions to the places of a ring that it contains, one bit each. The two halves
  // of the set are looked up in tables.
  struct OnRing {
    static constexpr unsigned kHalf = kMostDirections / 2;

    unsigned operator()(Directions set) const {
      return halves[0][set & ((Directions{1} << kHalf) - 1)] | unsigned{halves[1][set >> kHalf]};
    }

    std::array<std::array<std::uint8_t, std::size_t{1} << kHalf>, 2> halves = {};
  };

  // The places of the ring of an earlier neighbour.
  struct RingSets {
    unsigned both(Directions my_set, Directions their_set) const {
      return mine(my_set) & theirs(their_set);
    }

    OnRing mine;
    OnRing theirs;
    // Bit s: whether the set s of places is nothing, or one run that leaves two places free; and
    // whether it has a subset that is neither.
    std::uint64_t runs = 0;
    std::uint64_t risky = 0;
  };

  struct Link {
    Directions existing = 0;
    std::array<Directions, kMostDirections> adjacent = {};  // neighbours that are neighbours
    std::array<Ring, kMostDirections> rings = {};
    std::array<RingSets, kMostDirections / 2> ring_sets;  // of the earlier directions
    // Its triangles: those of tetrahedra in the sample's layer, and in the one below.
    std::vector<Directions> above;
    std::vector<Directions> below;
    std::unique_ptr<std::atomic<ClusterFacts>[]> known;  // by the set
  };

  const Link& link_of(unsigned parity) const { return links_[links_.size() == 1 ? 0 : parity]; }
  void add_directions(Scheme scheme);
  void add_directions(BccPoint point);
  void sort_directions();
  // `has(parity, step)`: whether samples have the direction. A triangle is one of the layer below
  // if a corner is so far below the sample.
  template <class Has>
  Link make_link(unsigned parity, int below, Has has) const;
  Ring make_ring(const Link& link, std::size_t direction) const;
  static RingSets make_ring_sets(const Ring& ring);
  int find(const std::array<int, 3>& step) const;
  ClusterFacts find_facts(const Link& link, Directions set) const;
  Directions find_clashing(unsigned parity, std::size_t direction, Directions mine,
                           Directions theirs) const;

  std::vector<LinkDirection> directions_;
  Directions below_ = 0;
  std::vector<Link> links_;  // of even and odd samples, or of both
};

// Those of samples of five or six tetrahedra.
const Links& links_of(Scheme scheme);
const Links& links_of(BccPoint point);

// Those of all points that have clusters: samples, and on the body-centred lattice centres.
template <std::size_t kKinds>
using LinksOfKinds = std::array<const Links*, kKinds>;

}  // namespace isomesh::mesh
