// Finds what is joined where a surface is regularised, and counts what is left: one walk for an
// iso-value's signs, for the body-centred lattice and for labels, which have a Rule each
// (sign_clusters-inl.h, bcc_clusters-inl.h, label_clusters-inl.h). Rows of edges, rows of
// candidates and rows of clusters follow each other as z rises, each as far behind as the rule
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
#include <utility>
#include <vector>

#include <hwy/highway.h>

#include "server/mesh/extract/clusters.h"
#include "server/mesh/extract/crossed_rows.h"
#include "server/mesh/extract/links.h"
#include "server/mesh/extract/slabs.h"
#include "server/mesh/lattice/rows-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

// The points of a word of a row that may join crossings: those whose neighbours all are points of
// the volume. `kind`: 0 for samples, 1 for centres, of which each row has one less.
inline Word joining_points(const Marching& marching, std::uint32_t kind, std::size_t w,
                           std::uint32_t y, std::uint32_t z) {
  const std::uint32_t first = 1 + marching.margin;
  const auto is_within = [&](std::uint32_t at, std::uint32_t points) {
    return at >= first && at + first < points;
  };
  const Dims dims = {marching.dims.x - kind, marching.dims.y - kind, marching.dims.z - kind};
  if (!is_within(y, dims.y) || !is_within(z, dims.z)) return 0;
  const std::size_t begin = w * kWordBits;
  const auto below = [&](std::size_t end) {  // the samples before `end`
    return end <= begin ? 0 : end - begin >= kWordBits ? ~Word{0} : (Word{1} << (end - begin)) - 1;
  };
  return dims.x <= first ? 0 : below(dims.x - first) & ~below(first);
}

// The crossed edges that 64 samples own, by place: those whose crossing belongs to the first end,
// and to the second.
template <std::size_t kPlaces>
struct EdgeWords {
  Word any = 0;  // of both; without it the others mean nothing
  std::array<Word, kPlaces> first = {};
  std::array<Word, kPlaces> second = {};
};

// A set of directions for each of 64 samples: first a word for each direction, then turned so that
// each sample's directions are together.
class DirectionSets {
 public:
  Word& operator[](std::size_t direction) { return words_[direction / 8][direction % 8]; }

  void turn(std::size_t directions) {
    for (std::size_t i = 0; 8 * i < directions; ++i) bytes_[i] = transpose(words_[i]);
  }
  HWY_INLINE Directions of(unsigned bit) const {
    return bytes_[0][bit] | Directions{bytes_[1][bit]} << 8 | Directions{bytes_[2][bit]} << 16;
  }

 private:
  static constexpr std::size_t kBytes = (kMostDirections + 7) / 8;

  std::array<BitWords, kBytes> words_ = {};
  std::array<BitBytes, kBytes> bytes_ = {};
};

// The bits of the samples that are `step` after those of word w, which is -1, 0 or 1.
HWY_INLINE Word bits_beside(const Word* row, std::size_t w, std::size_t words, int step) {
  if (step == 0) return row[w];
  if (step < 0) return row[w] << 1 | (w == 0 ? 0 : row[w - 1] >> 63);
  return row[w] >> 1 | (w + 1 == words ? 0 : row[w + 1] << 63);
}

// A sample, or on the body-centred lattice (`kind` 1) the centre of the cell that begins there.
struct GridSample {
  std::size_t x = 0;
  std::uint32_t y = 0;
  std::uint32_t z = 0;
  std::uint32_t kind = 0;
};

// The vertices and triangles that vanish because a sample's clusters are vertices: in its own
// layer, modulo 2^64, and in the one below.
struct ClusterLoss {
  std::uint64_t vertices = 0;
  std::uint64_t vertices_below = 0;
  std::uint64_t triangles = 0;
  std::uint64_t triangles_below = 0;
};

// One layer, while it is counted.
struct CountedLayer {
  ClusterLayer clusters;
  std::uint64_t vertices = 0;
  std::uint64_t triangles = 0;
  CrossedRows crossed;

  void begin_row() {
    clusters.row_begin.push_back(static_cast<std::uint32_t>(clusters.words.size()));
    clusters.points_begin.push_back(static_cast<std::uint32_t>(clusters.points.size()));
  }

  void take_off(const ClusterLoss& loss) {
    vertices -= loss.vertices;
    triangles -= loss.triangles;
    clusters.vertices_below += loss.vertices_below;
    clusters.triangles_below += loss.triangles_below;
  }

  void end(std::uint32_t z, SurfaceCount& count) {
    clusters.row_begin.push_back(static_cast<std::uint32_t>(clusters.words.size()));
    if (clusters.words.empty()) clusters = {};
    count.clusters[z] = std::move(clusters);
    count.crossed[z] = crossed;
    count.layer_vertices[z + 1] = vertices;
    count.layer_triangles[z + 1] = triangles;
  }
};

// Returns the components of the sample's own crossings that keep the first two conditions of
// links.h. `crossed()`: in which directions there are crossings, asked for when that matters.
template <class Crossed>
HWY_INLINE Directions components_to_join(const Links& links, unsigned parity, Directions own,
                                         Crossed crossed) {
  const auto allowed = [&](Directions component, const ClusterFacts& facts) {
    if (!facts.may_join()) return Directions{0};
    if (facts.forbidden() != 0 && (facts.forbidden() & crossed()) != 0) return Directions{0};
    return component;
  };
  const ClusterFacts all = links.facts(parity, own);
  if (all.components() == 1) return allowed(own, all);
  Directions kept = 0;
  while (own != 0) {
    const Directions component = links.facts(parity, own).first();
    kept |= allowed(component, links.facts(parity, component));
    own &= ~component;
  }
  return kept;
}

// The loss if each of the components in `joined` becomes a vertex.
HWY_INLINE ClusterLoss loss_of_components(const Links& links, Directions joined,
                                          const ClusterFacts& facts) {
  const auto below = static_cast<std::uint64_t>(std::popcount(joined & links.below()));
  const auto all = static_cast<std::uint64_t>(std::popcount(joined));
  // A component's vertex is one of the layer, whatever its crossings were.
  return {.vertices = all - below - facts.components(),
          .vertices_below = below,
          .triangles = facts.lost_above(),
          .triangles_below = facts.lost_below()};
}

// Finds the clusters of one slab's planes. Of a Rule, which is made from Marched and the first
// plane that it is asked for:
//  * kKinds, links(marched): the kinds of points that have clusters, and their links. With two
//    kinds, a row's clusters of centres follow those of its samples;
//  * kPlaces: the places that split_edges fills for each sample;
//  * reach(z): what follows is asked of the samples of planes z - 1 and z;
//  * open(z): they are going to be of plane z + 1, too;
//  * split_edges(w, y, z, words): the crossed edges of a word of samples, and what they and their
//    cells would have without clusters;
//  * candidates(sample, own, crossed): those of its own directions that may be joined, and flags of
//    Joined; crossed() tells all that are crossed;
//  * may_clash(w, sample, neighbour, step): the samples of word w whose candidates may clash with
//    those of their neighbours, `step` farther along x in another row;
//  * clashing(sample, direction, neighbour, mine, theirs): those of the candidates that clash with
//    the neighbour's;
//  * loss(sample, joined, layer): what the clusters save. Adds their points to the layer.
template <class Rule>
class ClusterWalk {
 public:
  using Marched = typename Rule::Marched;
  static constexpr std::uint32_t kKinds = Rule::kKinds;

  ClusterWalk(const Marched& marched, const Slab& slab, SurfaceCount& count)
      : marched_(marched),
        links_(Rule::links(marched)),
        dims_(marched.dims),
        slab_(slab),
        count_(count),
        words_(words_of(dims_.x)),
        first_plane_(slab.begin - std::min(slab.begin, 2U)),
        rule_(marched, first_plane_),
        edge_rows_(std::size_t{dims_.y} + 2),
        edges_(edge_rows_ * words_),
        candidates_(std::size_t{2} * dims_.y * kKinds * words_),
        directions_(std::size_t{2} * dims_.y * kKinds * dims_.x) {}

  // The rule of a sample looks at the edges that samples of the plane below own, and at what the
  // samples there might join.
  void count(const LayerEnded& ended = {}) {
    if (first_plane_ < slab_.end) rule_.open(first_plane_);
    for (std::uint32_t z = first_plane_; z < slab_.end; ++z) {
      rule_.reach(z);
      rule_.open(z + 1);
      layer_ = {};
      for (std::uint32_t y = 0; y < dims_.y; ++y) {
        find_edges(y, z);
        for (std::uint32_t kind = 0; kind < kKinds && z + 1 >= slab_.begin; ++kind) {
          find_candidates(kind, y, z);
        }
        // The earlier neighbours of centres are samples of the next row, too.
        if (z >= slab_.begin && y + 1 >= kKinds) find_clusters(y + 1 - kKinds, z);
      }
      if (z < slab_.begin) continue;
      if (kKinds > 1) find_clusters(dims_.y - 1, z);
      layer_.end(z, count_);
      if (ended) ended(z);
    }
  }

 private:
  using Edges = EdgeWords<Rule::kPlaces>;

  // Splits the crossed edges that the row's samples own by the end that each belongs to.
  void find_edges(std::uint32_t y, std::uint32_t z) {
    Edges* out = edges(y, z);
    OwnersOfRow owners;
    for (std::size_t w = 0; w < words_; ++w) {
      const WordCount plain = rule_.split_edges(w, y, z, out[w]);
      layer_.vertices += plain.vertices;
      layer_.triangles += plain.triangles;
      owners.add(w, out[w].any);
    }
    owners.add_to(marched_, y, z, layer_.crossed);
  }

  void find_candidates(std::uint32_t kind, std::uint32_t y, std::uint32_t z) {
    Word* candidates = candidate_points(kind, y, z);
    const std::size_t directions = links_[kind]->directions().size();
    for (std::size_t w = 0; w < words_; ++w) {
      candidates[w] = 0;
      const Word joining = joining_points(marched_, kind, w, y, z);
      if (joining == 0 || !look_around(w, y, z)) continue;
      const Word owners = gather(Which::kOwn, kind, own_);
      if ((joining & owners) == 0) continue;
      own_.turn(directions);
      bool knows_crossed = false;
      Directions* kept = candidate_directions(kind, y, z) + w * kWordBits;
      for (Word rest = joining & owners; rest != 0; rest &= rest - 1) {
        const auto bit = static_cast<unsigned>(std::countr_zero(rest));
        const auto crossed = [&] {
          if (!std::exchange(knows_crossed, true)) {
            gather(Which::kCrossed, kind, crossed_);
            crossed_.turn(directions);
          }
          return crossed_.of(bit);
        };
        kept[bit] = rule_.candidates({w * kWordBits + bit, y, z, kind}, own_.of(bit), crossed);
        candidates[w] |= Word{kept[bit] != 0} << bit;
      }
    }
  }

  // Looks up what the samples of word w and those around them own. Returns false if that is
  // nothing.
  bool look_around(std::size_t w, std::uint32_t y, std::uint32_t z) {
    static constexpr Edges kNone = {};
    Word any = 0;
    for (unsigned r = 0; r < 4; ++r) {
      const Edges* row = edges(y - (r & 1), z - (r >> 1));
      here_[r] = row[w].any == 0 ? &kNone : &row[w];
      before_[r] = w == 0 || row[w - 1].any == 0 ? &kNone : &row[w - 1];
      any |= here_[r]->any | here_[r]->any << 1 | before_[r]->any >> 63;
    }
    even_ = marched_.parity(0, y, z) == 0 ? kEvenX : ~kEvenX;
    return any != 0;
  }

  enum class Which { kOwn, kCrossed };

  // Sets sets[d] to the samples with a crossing in direction d: their own, or any. Returns the
  // samples that have one.
  HWY_INLINE Word gather(Which which, std::uint32_t kind, DirectionSets& sets) const {
    Word any = 0;
    const auto directions = links_[kind]->directions();
    for (std::size_t d = 0; d < directions.size(); ++d) {
      const unsigned place = directions[d].place;
      const auto bits_of = [&](const Edges& words) {
        if (which == Which::kCrossed) return words.first[place] | words.second[place];
        return directions[d].is_end ? words.second[place] : words.first[place];
      };
      const unsigned owner = directions[d].corner >> 1;
      Word bits = bits_of(*here_[owner]);
      if ((directions[d].corner & 1) != 0) bits = bits << 1 | bits_of(*before_[owner]) >> 63;
      // In the five-way split, diagonals join only even samples.
      const bool is_diagonal = marched_.scheme == Scheme::kFive && (place & (place - 1)) != 0;
      if (is_diagonal) bits &= even_;
      sets[d] = bits;
      any |= bits;
    }
    return any;
  }

  // Keeps the candidates in a row that clash with none of an earlier point.
  void find_clusters(std::uint32_t y, std::uint32_t z) {
    for (std::uint32_t kind = 0; kind < kKinds; ++kind) find_clusters(kind, y, z);
  }

  void find_clusters(std::uint32_t kind, std::uint32_t y, std::uint32_t z) {
    layer_.begin_row();
    const Links& links = *links_[kind];
    const Word* candidates = candidate_points(kind, y, z);
    for (std::size_t w = 0; w < words_; ++w) {
      if (candidates[w] == 0) continue;
      look_at_earlier(w, {0, y, z, kind});
      JoiningWord joining = {0, static_cast<std::uint32_t>(w),
                             static_cast<std::uint32_t>(layer_.clusters.joined.size())};
      for (Word rest = candidates[w]; rest != 0; rest &= rest - 1) {
        const auto bit = static_cast<unsigned>(std::countr_zero(rest));
        const GridSample sample = {w * kWordBits + bit, y, z, kind};
        const Directions all = candidate_directions(kind, y, z)[sample.x];
        ClusterFacts facts = links.facts(parity(sample), all & ~Joined::kFlags);
        const Directions risks = facts.risks() & earlier_.of(bit);
        Directions kept = all;
        if (risks != 0) {
          kept = without_clashes(sample, all, risks);
          if ((kept & ~Joined::kFlags) == 0) continue;
          if (kept != all) {
            kept &= ~Joined::kWhole;
            facts = links.facts(parity(sample), kept & ~Joined::kFlags);
          }
        }
        if (facts.components() > 1) kept |= Joined::kSeveral;
        joining.samples |= Word{1} << bit;
        layer_.clusters.joined.push_back({kept});
        layer_.take_off(rule_.loss(sample, {kept}, facts, layer_.clusters));
      }
      if (joining.samples != 0) layer_.clusters.words.push_back(joining);
    }
  }

  // Finds for the points of word w, the first of which is `at`, in which of the earlier directions
  // candidates may clash.
  void look_at_earlier(std::size_t w, const GridSample& at) {
    const std::size_t half = links_[at.kind]->half();
    for (std::size_t i = 0; i < half; ++i) {
      const GridSample to = beside(at, half + i);
      const int step = static_cast<int>(to.x - at.x);
      earlier_[i] = bits_beside(candidate_points(to.kind, to.y, to.z), w, words_, step) &
                    rule_.may_clash(w, at, to, step);
    }
    earlier_.turn(half);
  }

  Directions without_clashes(const GridSample& sample, Directions mine, Directions risks) {
    Directions kept = mine;
    for (Directions rest = risks; rest != 0; rest &= rest - 1) {
      const std::size_t d =
          links_[sample.kind]->half() + static_cast<std::size_t>(std::countr_zero(rest));
      const GridSample to = beside(sample, d);
      kept &= ~rule_.clashing(sample, d, to, mine, candidate_directions(to.kind, to.y, to.z)[to.x]);
    }
    return kept;
  }

  // The neighbour in a direction.
  GridSample beside(const GridSample& at, std::size_t direction) const {
    const auto& step = links_[at.kind]->directions()[direction].step;
    const auto plus = [&](auto from, std::size_t axis) {
      // In half cells, rounded down.
      const int way = kKinds == 1 ? step[axis] : (step[axis] + static_cast<int>(at.kind)) >> 1;
      return from + static_cast<decltype(from)>(way);
    };
    const std::uint32_t kind = kKinds == 1 || step[0] % 2 == 0 ? at.kind : 1 - at.kind;
    return {plus(at.x, 0), plus(at.y, 1), plus(at.z, 2), kind};
  }

  unsigned parity(const GridSample& sample) const {
    return marched_.parity(sample.x, sample.y, sample.z);
  }
  Edges* edges(std::uint32_t y, std::uint32_t z) {
    return &edges_[(std::size_t{z} * dims_.y + y) % edge_rows_ * words_];
  }
  std::size_t candidate_row(std::uint32_t kind, std::uint32_t y, std::uint32_t z) const {
    return (std::size_t{z % 2} * dims_.y + y) * kKinds + kind;
  }
  Word* candidate_points(std::uint32_t kind, std::uint32_t y, std::uint32_t z) {
    return &candidates_[candidate_row(kind, y, z) * words_];
  }
  Directions* candidate_directions(std::uint32_t kind, std::uint32_t y, std::uint32_t z) {
    return &directions_[candidate_row(kind, y, z) * dims_.x];
  }

  const Marched& marched_;
  const LinksOfKinds<kKinds> links_;
  const Dims dims_;
  const Slab slab_;
  SurfaceCount& count_;
  const std::size_t words_;
  const std::uint32_t first_plane_;
  Rule rule_;
  const std::size_t edge_rows_;  // as many as gather looks back
  std::vector<Edges> edges_;
  std::vector<Word> candidates_;        // of two planes: which points have some
  std::vector<Directions> directions_;  // and in which directions
  // Around the word that is looked at: the edges of the rows (y, z), (y - 1, z), (y, z - 1), ...
  // there and in the word before, the samples of even parity, and what is found in them.
  std::array<const Edges*, 4> here_ = {};
  std::array<const Edges*, 4> before_ = {};
  Word even_ = 0;
  DirectionSets own_;
  DirectionSets crossed_;
  DirectionSets earlier_;
  CountedLayer layer_;
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
