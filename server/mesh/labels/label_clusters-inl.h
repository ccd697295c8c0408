// The rule of the walk over clusters for labels. Compiled once for each instruction set, see
// slabs.cpp.
//
// Labels have no values, so of two the larger owns the crossing between them. Around a sample with
// one other label beside its own this is the rule of links.h. Where there are more, points of faces
// and centres (wall_cases.h) belong to their largest label as crossings do, and the sample joins
// all that it owns in one vertex, or nothing. It joins them if the first two conditions of links.h
// hold, and
//  * the first one also holds for the directions of each label alone;
//  * there are no more than three labels in those directions, and with three of them one point
//    where these and the sample's own meet, and the first condition holds for each two of them;
//  * on the ring of an earlier neighbour, what both join is nothing, or one run that leaves two
//    places free, in which the label changes once at most; and so is what has each label alone.
// So the vertex is a disk in each wall, an arc of each curve and a point where curves meet, and
// each label's own surface stays a manifold of the same topology. That of several labels together
// need not: an edge may lie between the same two vertices of a curve in two walls. So where a label
// has several parts (label_parts.h), nothing is joined at junctions.
#if defined(ISOMESH_LABEL_CLUSTERS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_LABEL_CLUSTERS_INL_H_
#undef ISOMESH_LABEL_CLUSTERS_INL_H_
#else
#define ISOMESH_LABEL_CLUSTERS_INL_H_
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include <hwy/highway.h>

#include "server/mesh/extract/clusters-inl.h"
#include "server/mesh/extract/links.h"
#include "server/mesh/labels/labels-inl.h"
#include "server/mesh/labels/star_points.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

class LabelClusters {
 public:
  using Marched = Separation;
  static constexpr std::uint32_t kKinds = 1;
  static constexpr std::size_t kPlaces = kEdgePlaces;

  static LinksOfKinds<1> links(const Separation& separation) {
    return {&links_of(separation.scheme)};
  }

  LabelClusters(const Separation& separation, std::uint32_t first)
      : separation_(separation),
        links_(links_of(separation.scheme)),
        points_(star_points(separation.scheme)),
        field_(separation, first) {}

  void reach(std::uint32_t z) { field_.reach(z); }
  void open(std::uint32_t /*z*/) {}

  WordCount split_edges(std::size_t w, std::uint32_t y, std::uint32_t z,
                        EdgeWords<kPlaces>& out) const {
    out.any = 0;
    const LabelRow row = field_.row(y, z);
    if (!row.may_cross(w)) return {};
    std::array<Word, 8> crossed;
    const WordCount count = row.count(w, crossed);
    for (const Word all : crossed) out.any |= all;
    for (unsigned direction = 1; direction < 8; ++direction) {
      const Word all = crossed[direction];
      const Word first = all == 0 ? 0 : all & row.first_is_larger(w, direction);
      out.first[direction] = first;
      out.second[direction] = all & ~first;
    }
    return count;
  }

  template <class Crossed>
  Directions candidates(const GridSample& at, Directions own, Crossed crossed) {
    look_around(at);
    if (!is_junction(crossed())) {
      const Directions joined = components_to_join(links_, parity(at), own, crossed);
      return joined == own ? joined | Joined::kWhole : joined;
    }
    const bool joins = !separation_.parts.overlap() && joins_all(at, own, crossed());
    return joins ? own | Joined::kJunction : 0;
  }

  // Any samples may clash: their labels are looked up later.
  static Word may_clash(std::size_t /*w*/, const GridSample& /*at*/, const GridSample& /*to*/,
                        int /*step*/) {
    return ~Word{0};
  }

  Directions clashing(const GridSample& at, std::size_t direction, const GridSample& to,
                      Directions mine, Directions theirs) {
    const bool has_junction = ((mine | theirs) & Joined::kJunction) != 0;
    const Directions own = mine & ~Joined::kFlags;
    const Directions others = theirs & ~Joined::kFlags;
    if (!has_junction) {
      if (label(at) != label(to)) return 0;
      return links_.clashing(parity(at), direction, own, others);
    }
    look_around(at);
    return meet_well(at, direction, own, others) ? 0 : mine;
  }

  ClusterLoss loss(const GridSample& at, Joined kept, const ClusterFacts& facts,
                   ClusterLayer& layer) {
    const Directions joined = kept.directions();
    if (!kept.is_junction()) return loss_of_components(links_, joined, facts);
    look_around(at);
    JoinedPoints points = {};
    ClusterLoss loss = {.vertices = ~std::uint64_t{0}};  // one vertex remains
    const StarPoints& all = points_[parity(at)];
    const auto lose = [&](const StarPoint& point) {
      ++(point.is_below ? loss.vertices_below : loss.vertices);
    };
    for (Directions rest = joined; rest != 0; rest &= rest - 1) lose(all[0][first_of(rest)]);
    for (std::size_t kind = 1; kind < all.size(); ++kind) {
      points[kind - 1] = points_among(all[kind], joined);
      for (std::uint64_t rest = points[kind - 1]; rest != 0; rest &= rest - 1) {
        lose(all[kind][static_cast<std::size_t>(std::countr_zero(rest))]);
      }
    }
    layer.points.push_back(points);
    for (const Directions corners : links_.above(parity(at))) {
      loss.triangles += lost_triangles(corners & joined);
    }
    for (const Directions corners : links_.below(parity(at))) {
      loss.triangles_below += lost_triangles(corners & joined);
    }
    return loss;
  }

 private:
  static std::size_t first_of(Directions set) {
    return static_cast<std::size_t>(std::countr_zero(set));
  }

  unsigned parity(const GridSample& at) const { return separation_.parity(at.x, at.y, at.z); }
  PartNumber label(const GridSample& at) const { return field_.labels(at.y, at.z)[at.x]; }

  // Looks up the labels of the sample's neighbours, those that the volume has.
  void look_around(const GridSample& at) {
    const auto directions = links_.directions();
    if (row_ != std::pair(at.y, at.z)) {
      for (std::size_t d = 0; d < directions.size(); ++d) {
        const auto& step = directions[d].step;
        rows_[d] = field_.labels(at.y + static_cast<std::uint32_t>(step[1]),
                                 at.z + static_cast<std::uint32_t>(step[2])) +
                   step[0];
      }
      row_ = std::pair(at.y, at.z);
    }
    for (std::size_t d = 0; d < directions.size(); ++d) around_[d] = rows_[d][at.x];
    around_[kMostDirections] = label(at);
  }

  // True if the neighbours with other labels have more than one label.
  bool is_junction(Directions crossed) const {
    const PartNumber first = around_[first_of(crossed)];
    for (Directions rest = crossed & (crossed - 1); rest != 0; rest &= rest - 1) {
      if (around_[first_of(rest)] != first) return true;
    }
    return false;
  }

  // Those of `set` in which the neighbour has that label.
  Directions with_label(Directions set, PartNumber wanted) const {
    Directions found = 0;
    for (Directions rest = set; rest != 0; rest &= rest - 1) {
      const std::size_t d = first_of(rest);
      if (around_[d] == wanted) found |= Directions{1} << d;
    }
    return found;
  }

  bool is_disk(unsigned parity, Directions set) const {
    const ClusterFacts facts = links_.facts(parity, set);
    return facts.components() == 1 && facts.may_join();
  }

  bool joins_all(const GridSample& at, Directions own, Directions crossed) const {
    const unsigned here = parity(at);
    if (!is_disk(here, own)) return false;
    if ((links_.facts(here, own).forbidden() & crossed) != 0) return false;
    std::size_t labels = 0;
    std::array<Directions, 3> groups = {};
    for (Directions rest = own; rest != 0; ++labels) {
      if (labels == groups.size()) return false;
      groups[labels] = with_label(rest, around_[first_of(rest)]);
      rest &= ~groups[labels];
    }
    if (labels == 1) return true;
    for (std::size_t n = 0; n < labels; ++n) {
      if (!is_disk(here, groups[n])) return false;
      if (labels == 3 && !is_disk(here, own & ~groups[n])) return false;
    }
    return labels < 3 || std::has_single_bit(points_among(points_[here][2], own));
  }

  bool meet_well(const GridSample& at, std::size_t direction, Directions mine,
                 Directions theirs) const {
    const unsigned here = parity(at);
    if (links_.clash(here, direction, mine, theirs)) return false;
    const Links::Ring& ring = links_.ring(here, direction);
    Directions both = 0;
    unsigned changes = 0;
    const auto is_in_both = [&](std::size_t i) {
      return (mine >> ring.mine[i] & theirs >> ring.theirs[i] & 1) != 0;
    };
    for (std::size_t i = 0; i < ring.size; ++i) {
      const std::size_t next = i + 1 == ring.size ? 0 : i + 1;
      if (!is_in_both(i)) continue;
      both |= Directions{1} << ring.mine[i];
      if (is_in_both(next) && around_[ring.mine[i]] != around_[ring.mine[next]]) ++changes;
    }
    if (changes > 1) return false;
    while (both != 0) {
      const Directions group = with_label(both, around_[first_of(both)]);
      if (links_.clash(here, direction, group, theirs)) return false;
      both &= ~group;
    }
    return true;
  }

  // The points whose neighbours all are in the set of crossings and have different labels; a bit
  // for each place in the list. Without branches: no processor could predict them.
  std::uint64_t points_among(std::span<const StarPoint> points, Directions set) const {
    std::uint64_t found = 0;
    for (std::size_t n = 0; n < points.size(); ++n) {
      const StarPoint& point = points[n];
      const PartNumber a = around_[point.members[0]];
      const PartNumber b = around_[point.members[1]];
      const PartNumber c = around_[point.members[2]];
      const auto is_among = static_cast<unsigned>((point.neighbours & ~set) == 0) &
                            static_cast<unsigned>(a != b) & static_cast<unsigned>(b != c) &
                            static_cast<unsigned>(c != a);
      found |= std::uint64_t{is_among} << n;
    }
    return found;
  }

  // How many triangles vanish in a tetrahedron some of whose corners the sample joins, those in
  // `joined`: all with two vertices that are joined. By the cases of wall_cases.h, two joined
  // corners lose one beside each label. Three lose all but one or two, if all vertices are joined
  // but those between other labels.
  std::uint64_t lost_triangles(Directions joined) const {
    const int size = std::popcount(joined);
    if (size < 2) return 0;
    std::uint64_t labels = 0;
    while (joined != 0) {
      joined &= ~with_label(joined, around_[first_of(joined)]);
      ++labels;
    }
    return size == 2 ? labels : labels * labels;
  }

  const Separation& separation_;
  const Links& links_;
  const std::array<StarPoints, 2>& points_;
  LabelField field_;
  std::optional<std::pair<std::uint32_t, std::uint32_t>> row_;  // that rows_ are around
  std::array<const PartNumber*, kMostDirections> rows_ = {};    // of the neighbours, by direction
  std::array<PartNumber, kMostDirections + 1> around_ = {};     // and the sample's own
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
