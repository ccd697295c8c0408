// Finds what is joined where a surface is regularised, and counts what is left. Rows of edges, rows
// of candidates and rows of clusters follow each other as z rises, each as far behind as the rule
// looks ahead. Compiled once for each instruction set, see slabs.cpp.
#if defined(ISOMESH_CLUSTERS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_CLUSTERS_INL_H_
#undef ISOMESH_CLUSTERS_INL_H_
#else
#define ISOMESH_CLUSTERS_INL_H_
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include <hwy/highway.h>

#include "server/mesh/extract/clusters.h"
#include "server/mesh/extract/links.h"
#include "server/mesh/extract/signs-inl.h"
#include "server/mesh/extract/slabs.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

// The samples of a word of a row that may join crossings: those whose neighbours all are samples of
// the volume.
inline Word joining_samples(const Extraction& extraction, std::size_t w, std::uint32_t y,
                            std::uint32_t z) {
  const std::uint32_t first = 1 + extraction.margin;
  const auto is_within = [&](std::uint32_t at, std::uint32_t samples) {
    return at >= first && at + first < samples;
  };
  const Dims& dims = extraction.dims;
  if (!is_within(y, dims.y) || !is_within(z, dims.z)) return 0;
  const std::size_t begin = w * kWordBits;
  const auto below = [&](std::size_t end) {  // the samples before `end`
    return end <= begin ? 0 : end - begin >= kWordBits ? ~Word{0} : (Word{1} << (end - begin)) - 1;
  };
  return dims.x <= first ? 0 : below(dims.x - first) & ~below(first);
}

// How near the samples of two planes are to the iso-value. Each word of a row is looked up once, if
// it is asked for.
class NearnessPlanes {
 public:
  explicit NearnessPlanes(const Extraction& extraction)
      : extraction_(extraction),
        words_(words_of(extraction.dims.x) + 1),
        rows_(std::size_t{2} * extraction.dims.y),
        known_(rows_ * words_),
        values_(rows_ * words_ * kWordBits) {}

  // Forgets the plane before the last one that was asked for.
  void open(std::uint32_t z) {
    std::fill_n(known_.data() + first_row(z) * words_, words_ * rows_ / 2, std::uint8_t{0});
  }

  // Those of the samples from word w on, of which 65 can be read.
  const std::int32_t* from(std::size_t w, std::uint32_t y, std::uint32_t z) {
    const std::size_t word = (first_row(z) + y) * words_ + w;
    for (std::size_t i = 0; i < 2; ++i) {
      if (known_[word + i] == 0) look_up(w + i, y, z, &values_[(word + i) * kWordBits]);
      known_[word + i] = 1;
    }
    return &values_[word * kWordBits];
  }

 private:
  std::size_t first_row(std::uint32_t z) const { return z % 2 * (rows_ / 2); }

  void look_up(std::size_t w, std::uint32_t y, std::uint32_t z, std::int32_t* out) const {
    std::fill_n(out, kWordBits, std::numeric_limits<std::int32_t>::max());
    const std::uint32_t margin = extraction_.margin;
    const Dims& inner = extraction_.inner;
    if (y - margin >= inner.y || z - margin >= inner.z) return;  // before the first, it wraps
    const std::size_t begin = std::max<std::size_t>(w * kWordBits, margin);
    const std::size_t end = std::min<std::size_t>((w + 1) * kWordBits, inner.x + margin);
    if (begin >= end) return;
    extraction_.samples->nearness(y - margin, z - margin,
                                  static_cast<std::uint32_t>(begin - margin),
                                  {out + (begin - w * kWordBits), end - begin});
  }

  const Extraction& extraction_;
  const std::size_t words_;  // of a row, and one that is read past the last
  const std::size_t rows_;
  std::vector<std::uint8_t> known_;
  std::vector<std::int32_t> values_;
};

HWY_INLINE Word less(const std::int32_t* a, const std::int32_t* b) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::CappedTag<std::int32_t, 8> eight;
  if constexpr (hn::MaxLanes(eight) == 8) {
    std::array<std::uint8_t, 16> bytes;  // eight of them may be written at once
    for (std::size_t i = 0; i < 8; ++i) {
      const auto is_less = hn::Lt(hn::LoadU(eight, a + 8 * i), hn::LoadU(eight, b + 8 * i));
      hn::StoreMaskBits(eight, is_less, bytes.data() + i);
    }
    Word word = 0;
    std::memcpy(&word, bytes.data(), sizeof word);
    return word;
  } else {
    std::array<std::uint8_t, kWordBits> flags;
    for (std::size_t x = 0; x < kWordBits; ++x) flags[x] = a[x] < b[x] ? 1 : 0;
    return pack_word(flags);
  }
}

// The crossed edges that 64 samples own, by direction: those whose crossing belongs to the first
// end, and to the second.
struct EdgeWords {
  Word any = 0;  // of both; without it the others mean nothing
  std::array<Word, 8> first = {};
  std::array<Word, 8> second = {};
};

// The crossings around 64 samples, by direction of Links, with zeros behind those.
struct StarWords {
  std::array<Word, 20> own = {};  // a multiple of four, for wide registers
  std::array<Word, 20> crossed = {};
};

// Finds the clusters of one slab's planes.
class ClusterWalk {
 public:
  ClusterWalk(const Extraction& extraction, const Slab& slab, SurfaceCount& count)
      : extraction_(extraction),
        links_(links_of(extraction.scheme)),
        dims_(extraction.dims),
        slab_(slab),
        count_(count),
        words_(words_of(dims_.x)),
        first_plane_(slab.begin - std::min(slab.begin, 2U)),
        field_(extraction, first_plane_),
        nearness_(extraction),
        edge_rows_(std::size_t{dims_.y} + 2),
        edges_(edge_rows_ * words_),
        candidates_(std::size_t{2} * dims_.y * words_),
        directions_(std::size_t{2} * dims_.y * dims_.x) {}

  // The rule of a sample looks at the edges that samples of the plane below own, and at what the
  // samples there might join.
  void count() {
    if (first_plane_ < slab_.end) nearness_.open(first_plane_);
    for (std::uint32_t z = first_plane_; z < slab_.end; ++z) {
      field_.reach(z);
      nearness_.open(z + 1);
      layer_ = {};
      vertices_ = 0;
      triangles_ = 0;
      for (std::uint32_t y = 0; y < dims_.y; ++y) {
        find_edges(y, z);
        if (z + 1 >= slab_.begin) find_candidates(y, z);
        if (z >= slab_.begin) find_clusters(y, z);
      }
      if (z >= slab_.begin) end_layer(z);
    }
  }

 private:
  // Splits the crossed edges that the row's samples own by the end that each belongs to.
  void find_edges(std::uint32_t y, std::uint32_t z) {
    const SignRow row = field_.row(y, z);
    EdgeWords* out = edges(y, z);
    for (std::size_t w = 0; w < words_; ++w) {
      out[w].any = 0;
      if (!row.may_cross(w)) continue;
      const CornerWords signs = row.corners(w);
      triangles_ += row.count_triangles(w, signs);
      const std::array<Word, 8> crossed = row.crossed_edges(w, signs);
      Word any = 0;
      for (const Word all : crossed) any |= all;
      if (any == 0) continue;
      out[w].any = any;
      std::array<const std::int32_t*, 4> near = {};  // from (y, z), (y + 1, z), ... on
      if (!extraction_.is_midpoint) {
        for (unsigned r = 0; r < 4; ++r) near[r] = nearness(w, y + (r & 1), z + (r >> 1));
      }
      const auto nearer = [&](unsigned a, unsigned b) {
        // All middles are as near to the one sample as to the other.
        if (extraction_.is_midpoint) return signs[a];
        return less(near[a >> 1] + (a & 1), near[b >> 1] + (b & 1));
      };
      for (unsigned direction = 1; direction < 8; ++direction) {
        const Word all = crossed[direction];
        const Word first = all == 0 ? 0 : all & row.between_ends(direction, nearer);
        out[w].first[direction] = first;
        out[w].second[direction] = all & ~first;
        vertices_ += static_cast<unsigned>(std::popcount(all));
      }
    }
  }

  // Beyond the last rows there is no edge to compare.
  const std::int32_t* nearness(std::size_t w, std::uint32_t y, std::uint32_t z) {
    return nearness_.from(w, std::min(y, dims_.y - 1), std::min(z, dims_.z - 1));
  }

  // Of the row's samples, the components that keep the first two conditions of links.h.
  void find_candidates(std::uint32_t y, std::uint32_t z) {
    Word* candidates = candidate_samples(y, z);
    std::fill_n(candidates, words_, 0);
    StarWords star;
    for (std::size_t w = 0; w < words_; ++w) {
      const Word joining = joining_samples(extraction_, w, y, z);
      if (joining == 0) continue;
      for (Word rest = joining & gather(w, y, z, star); rest != 0; rest &= rest - 1) {
        const auto bit = static_cast<unsigned>(std::countr_zero(rest));
        const std::size_t x = w * kWordBits + bit;
        const Directions kept = candidates_of(star, bit, parity(x, y, z));
        candidate_directions(y, z)[x] = kept;
        candidates[w] |= Word{kept != 0} << bit;
      }
    }
  }

  // What is crossed around the samples of word w, and which of those crossings are their own.
  // Returns the samples that have any.
  Word gather(std::size_t w, std::uint32_t y, std::uint32_t z, StarWords& star) {
    static constexpr EdgeWords kNone = {};
    std::array<const EdgeWords*, 4> here;    // of the rows (y, z), (y - 1, z), (y, z - 1), ...
    std::array<const EdgeWords*, 4> before;  // the words before those
    Word any = 0;
    for (unsigned r = 0; r < 4; ++r) {
      const EdgeWords* row = edges(y - (r & 1), z - (r >> 1));
      here[r] = row[w].any == 0 ? &kNone : &row[w];
      before[r] = w == 0 || row[w - 1].any == 0 ? &kNone : &row[w - 1];
      any |= here[r]->any | here[r]->any << 1 | before[r]->any >> 63;
    }
    if (any == 0) return 0;
    Word owners = 0;
    const auto directions = links_.directions();
    const Word even = parity(0, y, z) == 0 ? kEvenX : ~kEvenX;
    for (std::size_t d = 0; d < directions.size(); ++d) {
      const unsigned place = directions[d].place;
      const unsigned owner = directions[d].corner >> 1;
      Word first = here[owner]->first[place];
      Word second = here[owner]->second[place];
      if ((directions[d].corner & 1) != 0) {
        first = first << 1 | before[owner]->first[place] >> 63;
        second = second << 1 | before[owner]->second[place] >> 63;
      }
      // With five tetrahedra the diagonals join even samples.
      const bool is_diagonal = extraction_.scheme == Scheme::kFive && (place & (place - 1)) != 0;
      const Word there = is_diagonal ? even : ~Word{0};
      star.own[d] = (directions[d].is_end ? second : first) & there;
      star.crossed[d] = (first | second) & there;
      owners |= star.own[d];
    }
    return owners;
  }

  Directions candidates_of(const StarWords& star, unsigned bit, unsigned parity) const {
    const Directions crossed = directions_at(star.crossed, bit);
    Directions kept = 0;
    for (Directions own = directions_at(star.own, bit); own != 0;) {
      ClusterFacts facts = links_.facts(parity, own);
      const Directions component = facts.first();
      if (component != own) facts = links_.facts(parity, component);
      own &= ~component;
      const bool is_allowed = (facts.forbidden() & crossed) == 0;
      const unsigned joins = unsigned{facts.may_join()} & unsigned{is_allowed};  // no branch
      kept |= joins != 0 ? component : 0;
    }
    return kept;
  }

  static Directions directions_at(const std::array<Word, 20>& words, unsigned bit) {
    Word directions = 0;
    for (std::size_t d = 0; d < words.size(); ++d) directions |= (words[d] >> bit & 1) << d;
    return static_cast<Directions>(directions);
  }

  // Of the candidates in a row, those that clash with none of an earlier sample.
  void find_clusters(std::uint32_t y, std::uint32_t z) {
    layer_.row_begin.push_back(static_cast<std::uint32_t>(layer_.samples.size()));
    const Word* candidates = candidate_samples(y, z);
    for (std::size_t w = 0; w < words_; ++w) {
      for (Word rest = candidates[w]; rest != 0; rest &= rest - 1) {
        const auto bit = static_cast<unsigned>(std::countr_zero(rest));
        const std::size_t x = w * kWordBits + bit;
        const Directions all = candidate_directions(y, z)[x];
        const ClusterFacts facts = links_.facts(parity(x, y, z), all);
        const Directions kept = facts.risks() == 0 ? all : without_clashes(x, y, z, facts);
        if (kept == 0) continue;
        add_clusters(x, kept, kept == all ? facts : links_.facts(parity(x, y, z), kept));
      }
    }
  }

  Directions without_clashes(std::size_t x, std::uint32_t y, std::uint32_t z,
                             const ClusterFacts& facts) {
    const Directions mine = candidate_directions(y, z)[x];
    const unsigned here = parity(x, y, z);
    Directions kept = mine;
    for (Directions rest = facts.risks(); rest != 0; rest &= rest - 1) {
      const std::size_t d = links_.half() + static_cast<std::size_t>(std::countr_zero(rest));
      const auto& step = links_.directions()[d].step;
      const std::size_t to_x = x + static_cast<std::size_t>(step[0]);
      const std::uint32_t to_y = y + static_cast<std::uint32_t>(step[1]);
      const std::uint32_t to_z = z + static_cast<std::uint32_t>(step[2]);
      if (!has(candidate_samples(to_y, to_z), to_x)) continue;
      if (has(field_.signs(to_y, to_z), to_x) != has(field_.signs(y, z), x)) continue;
      const Directions theirs = candidate_directions(to_y, to_z)[to_x];
      visit_components(here, mine, [&](Directions one) {
        visit_components(parity(to_x, to_y, to_z), theirs, [&](Directions other) {
          if (links_.clash(here, d, one, other)) kept &= ~one;
        });
      });
    }
    return kept;
  }

  template <class Visit>
  void visit_components(unsigned parity, Directions set, Visit visit) const {
    while (set != 0) {
      const Directions component = links_.facts(parity, set).first();
      visit(component);
      set &= ~component;
    }
  }

  void add_clusters(std::size_t x, Directions joined, const ClusterFacts& facts) {
    const Directions several = facts.components() == 1 ? 0 : JoiningSample::kSeveral;
    layer_.samples.push_back({static_cast<std::uint32_t>(x), joined | several});
    const auto below = static_cast<unsigned>(std::popcount(joined & links_.below()));
    vertices_ += facts.components();
    vertices_ -= static_cast<unsigned>(std::popcount(joined)) - below;
    triangles_ -= facts.lost_above();
    layer_.vertices_below += below;
    layer_.triangles_below += facts.lost_below();
  }

  void end_layer(std::uint32_t z) {
    layer_.row_begin.push_back(static_cast<std::uint32_t>(layer_.samples.size()));
    if (layer_.samples.empty()) layer_ = {};
    count_.clusters[z] = std::move(layer_);
    count_.layer_vertices[z + 1] = vertices_;
    count_.layer_triangles[z + 1] = triangles_;
  }

  static bool has(const Word* row, std::size_t x) {
    return (row[x / kWordBits] >> (x % kWordBits) & 1) != 0;
  }

  unsigned parity(std::size_t x, std::uint32_t y, std::uint32_t z) const {
    return extraction_.parity(x, y, z);
  }
  EdgeWords* edges(std::uint32_t y, std::uint32_t z) {
    return &edges_[(std::size_t{z} * dims_.y + y) % edge_rows_ * words_];
  }
  std::size_t candidate_row(std::uint32_t y, std::uint32_t z) const {
    return std::size_t{z % 2} * dims_.y + y;
  }
  Word* candidate_samples(std::uint32_t y, std::uint32_t z) {
    return &candidates_[candidate_row(y, z) * words_];
  }
  Directions* candidate_directions(std::uint32_t y, std::uint32_t z) {
    return &directions_[candidate_row(y, z) * dims_.x];
  }

  const Extraction& extraction_;
  const Links& links_;
  const Dims dims_;
  const Slab slab_;
  SurfaceCount& count_;
  const std::size_t words_;
  const std::uint32_t first_plane_;
  SignField field_;
  NearnessPlanes nearness_;
  const std::size_t edge_rows_;  // as many as gather looks back
  std::vector<EdgeWords> edges_;
  std::vector<Word> candidates_;        // of two planes: which samples have some
  std::vector<Directions> directions_;  // and in which directions
  ClusterLayer layer_;
  std::uint64_t vertices_ = 0;  // of the layer
  std::uint64_t triangles_ = 0;
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
