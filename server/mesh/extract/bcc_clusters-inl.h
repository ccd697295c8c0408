// Finds what is joined where a surface on the body-centred lattice is regularised, and counts what
// is left: samples and centres are points with fourteen neighbours each, for which the rule of
// links.h holds. Compiled once for each instruction set, see slabs.cpp.
#if defined(ISOMESH_BCC_CLUSTERS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_BCC_CLUSTERS_INL_H_
#undef ISOMESH_BCC_CLUSTERS_INL_H_
#else
#define ISOMESH_BCC_CLUSTERS_INL_H_
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <hwy/highway.h>

#include "server/mesh/extract/bcc_signs-inl.h"
#include "server/mesh/extract/clusters-inl.h"
#include "server/mesh/extract/clusters.h"
#include "server/mesh/extract/links.h"
#include "server/mesh/extract/sign_clusters-inl.h"
#include "server/mesh/extract/slabs.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

inline constexpr std::array kBccPoints = {BccPoint::kSample, BccPoint::kCentre};

class BccClusterWalk {
 public:
  BccClusterWalk(const Extraction& extraction, const Slab& slab, SurfaceCount& count)
      : extraction_(extraction),
        dims_(extraction.dims),
        slab_(slab),
        count_(count),
        words_(words_of(dims_.x)),
        first_plane_(slab.begin - std::min(slab.begin, 2U)),
        field_(extraction, first_plane_),
        kinds_{Kind(extraction, BccPoint::kSample), Kind(extraction, BccPoint::kCentre)} {
    for (unsigned slot = 0; slot < kBccDiagonalSlot; ++slot) ends_[slot] = ends_of(slot);
  }

  // Edges that records of a plane own lead to points of the plane above, so a plane's crossings are
  // complete once its own edges are known.
  void count() {
    if (first_plane_ < slab_.end) open(first_plane_);
    for (std::uint32_t z = first_plane_; z < slab_.end; ++z) {
      field_.reach(z);
      open(z + 1);
      layer_ = {};
      for (std::uint32_t y = 0; y < dims_.y; ++y) find_edges(y, z);
      if (z + 1 < slab_.begin) continue;
      for (const BccPoint point : kBccPoints) {
        for (std::uint32_t y = 0; y < dims_.y; ++y) find_candidates(point, y, z);
      }
      if (z >= slab_.begin) find_layer(z);
    }
  }

 private:
  // The crossings around a point: its own, and all.
  struct PointStar {
    std::uint16_t own = 0;
    std::uint16_t crossed = 0;
  };

  // The points of one kind in two planes; of the words those that own crossings, and those that
  // may join some.
  struct Kind {
    Kind(const Extraction& extraction, BccPoint point)
        : links(links_of(point)),
          nearness(extraction, point),
          rows(extraction.dims.y),
          width(extraction.dims.x),
          words(words_of(extraction.dims.x)),
          stars(2 * rows * width),
          owners(2 * rows * words),
          candidates(2 * rows * words),
          kept(2 * rows * width) {}

    std::size_t row(std::uint32_t y, std::uint32_t z) const { return z % 2 * rows + y; }
    PointStar* stars_of(std::uint32_t y, std::uint32_t z) { return &stars[row(y, z) * width]; }
    Word* owners_of(std::uint32_t y, std::uint32_t z) { return &owners[row(y, z) * words]; }
    Word* candidates_of(std::uint32_t y, std::uint32_t z) { return &candidates[row(y, z) * words]; }
    std::uint16_t* kept_of(std::uint32_t y, std::uint32_t z) { return &kept[row(y, z) * width]; }

    const Links& links;
    NearnessPlanes nearness;
    std::size_t rows;
    std::size_t width;
    std::size_t words;
    std::vector<PointStar> stars;
    std::vector<Word> owners;
    std::vector<Word> candidates;
    std::vector<std::uint16_t> kept;
  };

  // One end of the edge of a slot: the rows and samples after the record's, the point there, and
  // the edge's direction from it.
  struct End {
    BccPoint point = BccPoint::kSample;
    std::uint8_t x = 0;
    std::uint8_t y = 0;
    std::uint8_t z = 0;
    std::uint16_t direction = 0;  // its bit
  };

  using Ends = std::array<End, 2>;

  static Ends ends_of(unsigned slot) {
    const bool is_axis = slot >= kBccAxisSlot && slot < kBccCentreSlot;
    const BccPoint first = is_axis ? BccPoint::kSample : BccPoint::kCentre;
    const BccPoint second = slot < kBccCentreSlot ? BccPoint::kSample : BccPoint::kCentre;
    const unsigned corner = slot < kBccAxisSlot     ? slot
                            : slot < kBccCentreSlot ? 1U << (slot - kBccAxisSlot)
                                                    : 1U << (slot - kBccCentreSlot);
    return {End{first, 0, 0, 0, direction_of(first, slot, false)},
            End{second, static_cast<std::uint8_t>(corner & 1),
                static_cast<std::uint8_t>(corner >> 1 & 1), static_cast<std::uint8_t>(corner >> 2),
                direction_of(second, slot, true)}};
  }

  static std::uint16_t direction_of(BccPoint point, unsigned slot, bool is_end) {
    const auto directions = links_of(point).directions();
    const auto found = std::ranges::find_if(directions, [&](const LinkDirection& direction) {
      return direction.place == slot && direction.is_end == is_end;
    });
    return static_cast<std::uint16_t>(1U << (found - directions.begin()));
  }

  Kind& kind(BccPoint point) { return kinds_[static_cast<std::size_t>(point)]; }

  // Forgets the plane before the last one.
  void open(std::uint32_t z) {
    for (Kind& points : kinds_) {
      points.nearness.open(z);
      std::fill_n(points.stars_of(0, z), points.rows * points.width, PointStar{});
      std::fill_n(points.owners_of(0, z), points.rows * points.words, Word{0});
    }
  }

  void find_edges(std::uint32_t y, std::uint32_t z) {
    const BccRow row = field_.row(y, z);
    for (std::size_t w = 0; w < words_; ++w) {
      if (!row.may_cross(w)) continue;
      const CornerWords corners = row.corners(w);
      auto crossed = row.crossed_edges(w, corners);
      layer_.vertices += count_bits(crossed);
      layer_.triangles += row.count_triangles(w, corners);
      // Phantom cells have no centre, and no point of theirs may join crossings.
      crossed[0] &= ~row.split_in_six(w);
      for (unsigned slot = 0; slot < kBccDiagonalSlot; ++slot) {
        if (crossed[slot] == 0) continue;
        const Word inside = ends_[slot][0].point == BccPoint::kSample ? corners[0] : row.centre(w);
        add_edges(crossed[slot], ends_[slot], inside, w, y, z);
      }
    }
  }

  // Tells both ends of their crossings, and the nearer one that it is its own. `inside`: of the
  // first ends.
  void add_edges(Word crossed, const Ends& ends, Word inside, std::size_t w, std::uint32_t y,
                 std::uint32_t z) {
    std::array<PointStar*, 2> stars;
    std::array<Word*, 2> owners;
    std::array<const std::byte*, 2> near = {};
    const std::size_t bytes = kinds_[0].nearness.rank_bytes();
    for (std::size_t e = 0; e < 2; ++e) {
      Kind& points = kind(ends[e].point);
      const std::uint32_t end_y = y + ends[e].y;
      const std::uint32_t end_z = z + ends[e].z;
      stars[e] = points.stars_of(end_y, end_z) + ends[e].x;
      owners[e] = points.owners_of(end_y, end_z);
      if (extraction_.is_midpoint) continue;
      near[e] = points.nearness.from(w, end_y, end_z) + ends[e].x * bytes;
    }
    for (Word rest = crossed; rest != 0; rest &= rest - 1) {
      const auto bit = static_cast<unsigned>(std::countr_zero(rest));
      const std::size_t x = w * kWordBits + bit;
      for (std::size_t e = 0; e < 2; ++e) stars[e][x].crossed |= ends[e].direction;
      const bool is_first = extraction_.is_midpoint
                                ? (inside >> bit & 1) != 0
                                : is_less(bytes, near[0] + bit * bytes, near[1] + bit * bytes);
      const std::size_t owner = is_first ? 0 : 1;
      const std::size_t at = x + ends[owner].x;
      stars[owner][x].own |= ends[owner].direction;
      owners[owner][at / kWordBits] |= Word{1} << at % kWordBits;
    }
  }

  // The points whose neighbours all are points of the volume.
  Word joining_points(BccPoint point, std::size_t w, std::uint32_t y, std::uint32_t z) const {
    if (point == BccPoint::kSample) return joining_samples(extraction_, w, y, z);
    const BccShape& shape = field_.shape();
    if (!shape.has_row(std::int64_t{y} - 1, std::int64_t{z} - 1) ||
        !shape.has_row(std::int64_t{y} + 1, std::int64_t{z} + 1)) {
      return 0;
    }
    return shape.along_x(w).last & shape.along_x(w).next;
  }

  void find_candidates(BccPoint point, std::uint32_t y, std::uint32_t z) {
    Kind& points = kind(point);
    Word* candidates = points.candidates_of(y, z);
    std::fill_n(candidates, words_, Word{0});
    const PointStar* stars = points.stars_of(y, z);
    const Word* owners = points.owners_of(y, z);
    for (std::size_t w = 0; w < words_; ++w) {
      if (owners[w] == 0) continue;
      for (Word rest = owners[w] & joining_points(point, w, y, z); rest != 0; rest &= rest - 1) {
        const auto bit = static_cast<unsigned>(std::countr_zero(rest));
        const std::size_t x = w * kWordBits + bit;
        const Directions kept = components_to_join(points.links, 0, stars[x].own,
                                                   [&] { return Directions{stars[x].crossed}; });
        points.kept_of(y, z)[x] = static_cast<std::uint16_t>(kept);
        candidates[w] |= Word{kept != 0} << bit;
      }
    }
  }

  // A layer's rows are those of samples and of centres by turns.
  void find_layer(std::uint32_t z) {
    for (std::uint32_t y = 0; y < dims_.y; ++y) {
      for (const BccPoint point : kBccPoints) find_clusters(point, y, z);
    }
    layer_.end(z, count_);
  }

  // Keeps the candidates in a row that clash with none of an earlier point.
  void find_clusters(BccPoint point, std::uint32_t y, std::uint32_t z) {
    layer_.begin_row();
    Kind& points = kind(point);
    const Word* candidates = points.candidates_of(y, z);
    for (std::size_t w = 0; w < words_; ++w) {
      JoiningWord joining = {0, static_cast<std::uint32_t>(w),
                             static_cast<std::uint32_t>(layer_.clusters.joined.size())};
      for (Word rest = candidates[w]; rest != 0; rest &= rest - 1) {
        const auto bit = static_cast<unsigned>(std::countr_zero(rest));
        const GridSample at = {w * kWordBits + bit, y, z};
        const Directions all = points.kept_of(y, z)[at.x];
        const Directions risks = points.links.facts(0, all).risks();
        const Directions kept = risks == 0 ? all : without_clashes(point, at, all, risks);
        if (kept == 0) continue;
        joining.samples |= Word{1} << bit;
        add_clusters(points.links, kept);
      }
      if (joining.samples != 0) layer_.clusters.words.push_back(joining);
    }
  }

  Directions without_clashes(BccPoint point, const GridSample& at, Directions mine,
                             Directions risks) {
    const Kind& points = kind(point);
    const Directions crossed = kind(point).stars_of(at.y, at.z)[at.x].crossed;
    const int half = point == BccPoint::kCentre ? 1 : 0;
    Directions kept = mine;
    for (Directions rest = risks; rest != 0; rest &= rest - 1) {
      const std::size_t d = points.links.half() + static_cast<std::size_t>(std::countr_zero(rest));
      if ((crossed >> d & 1) != 0) continue;  // points on two sides share no crossing
      const auto& step = points.links.directions()[d].step;
      const auto cell = [&](int way) { return (way + half) >> 1; };  // rounds down
      Kind& others = (step[0] & 1) == 0           ? kind(point)
                     : point == BccPoint::kSample ? kind(BccPoint::kCentre)
                                                  : kind(BccPoint::kSample);
      const std::size_t x = at.x + static_cast<std::size_t>(cell(step[0]));
      const std::uint32_t y = at.y + static_cast<std::uint32_t>(cell(step[1]));
      const std::uint32_t z = at.z + static_cast<std::uint32_t>(cell(step[2]));
      if ((others.candidates_of(y, z)[x / kWordBits] >> x % kWordBits & 1) == 0) continue;
      kept &= ~points.links.clashing(0, d, mine, others.kept_of(y, z)[x]);
    }
    return kept;
  }

  void add_clusters(const Links& links, Directions joined) {
    const ClusterFacts facts = links.facts(0, joined);
    layer_.clusters.joined.push_back({joined | (facts.components() > 1 ? Joined::kSeveral : 0)});
    layer_.take_off(loss_of_components(links, joined, facts));
  }

  const Extraction& extraction_;
  const Dims dims_;
  const Slab slab_;
  SurfaceCount& count_;
  const std::size_t words_;
  const std::uint32_t first_plane_;
  BccField field_;
  std::array<Kind, 2> kinds_;
  std::array<Ends, kBccDiagonalSlot> ends_ = {};
  CountedLayer layer_;
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
