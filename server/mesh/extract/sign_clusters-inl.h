// The rule of the walk over clusters for an iso-value: a crossing belongs to the end whose value is
// nearer to the iso-value. Compiled once for each instruction set, see slabs.cpp.
#if defined(ISOMESH_SIGN_CLUSTERS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_SIGN_CLUSTERS_INL_H_
#undef ISOMESH_SIGN_CLUSTERS_INL_H_
#else
#define ISOMESH_SIGN_CLUSTERS_INL_H_
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include <hwy/highway.h>

#include "server/mesh/extract/clusters-inl.h"
#include "server/mesh/extract/links.h"
#include "server/mesh/extract/signs-inl.h"
#include "server/mesh/extract/slabs.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

// How near the samples of two planes, or the centres of their cells, are to the iso-value. Each
// word of a row is looked up once, if it is asked for.
class NearnessPlanes {
 public:
  explicit NearnessPlanes(const Extraction& extraction, BccPoint point = BccPoint::kSample)
      : extraction_(extraction),
        point_(point),
        rank_bytes_(extraction.samples->rank_bytes()),
        words_(words_of(extraction.dims.x) + 1),
        rows_(std::size_t{2} * extraction.dims.y),
        known_(rows_ * words_),
        ranks_(rows_ * words_ * kWordBits * rank_bytes_) {}

  std::size_t rank_bytes() const { return rank_bytes_; }

  // Forgets the plane before the last one that was asked for.
  void open(std::uint32_t z) {
    std::fill_n(known_.data() + first_row(z) * words_, words_ * rows_ / 2, std::uint8_t{0});
  }

  // The ranks of the samples from word w on, of which 65 can be read.
  const std::byte* from(std::size_t w, std::uint32_t y, std::uint32_t z) {
    const std::size_t word = (first_row(z) + y) * words_ + w;
    const std::size_t bytes = kWordBits * rank_bytes_;
    for (std::size_t i = 0; i < 2; ++i) {
      if (known_[word + i] == 0) look_up(w + i, y, z, &ranks_[(word + i) * bytes]);
      known_[word + i] = 1;
    }
    return &ranks_[word * bytes];
  }

 private:
  std::size_t first_row(std::uint32_t z) const { return z % 2 * (rows_ / 2); }

  // Phantoms keep what they have: samples beside them join nothing.
  void look_up(std::size_t w, std::uint32_t y, std::uint32_t z, std::byte* out) const {
    const std::uint32_t margin = extraction_.margin;
    const bool is_centre = point_ == BccPoint::kCentre;
    const std::uint32_t less = is_centre ? 1 : 0;
    const Dims inner = {extraction_.inner.x - less, extraction_.inner.y - less,
                        extraction_.inner.z - less};
    const std::size_t begin = std::max<std::size_t>(w * kWordBits, margin);
    const std::size_t end = std::min<std::size_t>((w + 1) * kWordBits, inner.x + margin);
    if (begin >= end || y - margin >= inner.y || z - margin >= inner.z) return;
    out += (begin - w * kWordBits) * rank_bytes_;
    const auto first = static_cast<std::uint32_t>(begin - margin);
    is_centre
        ? extraction_.samples->centre_nearness(y - margin, z - margin, first, end - begin, out)
        : extraction_.samples->nearness(y - margin, z - margin, first, end - begin, out);
  }

  const Extraction& extraction_;
  const BccPoint point_;
  const std::size_t rank_bytes_;
  const std::size_t words_;  // of a row, and one that is read past the last
  const std::size_t rows_;
  std::vector<std::uint8_t> known_;
  std::vector<std::byte> ranks_;
};

// Those of 64 samples that are nearer to the iso-value than what they are compared with; ranks
// begin there.
template <class Rank>
HWY_INLINE Word less(const Rank* a, const Rank* b) {
#if HWY_TARGET == HWY_AVX2
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::CappedTag<Rank, 32> ranks;
  constexpr std::size_t kLanes = 32 / sizeof(Rank);
  std::array<std::uint8_t, 16> bytes;  // eight of them may be written at once
  for (std::size_t i = 0; i < kWordBits; i += kLanes) {
    const auto is_less = hn::Lt(hn::LoadU(ranks, a + i), hn::LoadU(ranks, b + i));
    hn::StoreMaskBits(ranks, is_less, bytes.data() + i / 8);
  }
  Word word = 0;
  std::memcpy(&word, bytes.data(), sizeof word);
  return word;
#else
  BitBytes flags;
  for (std::size_t x = 0; x < kWordBits; ++x) flags[x] = a[x] < b[x] ? 1 : 0;
  return pack_word(flags);
#endif
}

// Calls visit(a rank) with the type of ranks that have so many bytes.
template <class Visit>
HWY_INLINE void with_rank(std::size_t bytes, Visit visit) {
  if (bytes == sizeof(std::int8_t)) return visit(std::int8_t{});
  if (bytes == sizeof(std::int16_t)) return visit(std::int16_t{});
  visit(std::int32_t{});
}

class SignClusters {
 public:
  using Marched = Extraction;
  static constexpr std::uint32_t kKinds = 1;
  static constexpr std::size_t kPlaces = kEdgePlaces;

  static LinksOfKinds<1> links(const Extraction& extraction) {
    return SignField::links(extraction);
  }

  SignClusters(const Extraction& extraction, std::uint32_t first)
      : extraction_(extraction),
        links_(links_of(extraction.scheme)),
        words_(words_of(extraction.dims.x)),
        last_y_(extraction.dims.y - 1),
        last_z_(extraction.dims.z - 1),
        field_(extraction, first),
        nearness_(extraction) {}

  void reach(std::uint32_t z) { field_.reach(z); }
  void open(std::uint32_t z) { nearness_.open(z); }

  WordCount split_edges(std::size_t w, std::uint32_t y, std::uint32_t z, EdgeWords<kPlaces>& out) {
    out.any = 0;
    const SignRow row = field_.row(y, z);
    if (!row.may_cross(w)) return {};
    const CornerWords signs = row.corners(w);
    WordCount count = {.vertices = 0, .triangles = row.count_triangles(w, signs)};
    const std::array<Word, 8> crossed = row.crossed_edges(w, signs);
    for (const Word all : crossed) out.any |= all;
    if (out.any == 0) return count;
    const std::array<Word, 8> first = first_ends(w, y, z, row, crossed);
    for (unsigned direction = 1; direction < 8; ++direction) {
      const Word all = crossed[direction];
      out.first[direction] = all & first[direction];
      out.second[direction] = all & ~first[direction];
      count.vertices += static_cast<unsigned>(std::popcount(all));
    }
    return count;
  }

  template <class Crossed>
  Directions candidates(const GridSample& at, Directions own, Crossed crossed) const {
    return components_to_join(links_, extraction_.parity(at.x, at.y, at.z), own, crossed);
  }

  // Samples on two sides share no crossing.
  Word may_clash(std::size_t w, const GridSample& at, const GridSample& to, int step) const {
    const Word there = bits_beside(field_.signs(to.y, to.z), w, words_, step);
    return ~(field_.signs(at.y, at.z)[w] ^ there);
  }

  Directions clashing(const GridSample& at, std::size_t direction, const GridSample& /*to*/,
                      Directions mine, Directions theirs) const {
    return links_.clashing(extraction_.parity(at.x, at.y, at.z), direction, mine, theirs);
  }

  ClusterLoss loss(const GridSample& /*at*/, Joined kept, const ClusterFacts& facts,
                   ClusterLayer& /*layer*/) const {
    return loss_of_components(links_, kept.directions(), facts);
  }

 private:
  // The samples whose crossed edge of each direction is nearer to its first end.
  std::array<Word, 8> first_ends(std::size_t w, std::uint32_t y, std::uint32_t z,
                                 const SignRow& row, const std::array<Word, 8>& crossed) {
    std::array<Word, 8> first = {};
    const auto find = [&](auto is_nearer) {
      for (unsigned direction = 1; direction < 8; ++direction) {
        if (crossed[direction] != 0) first[direction] = row.between_ends(direction, is_nearer);
      }
    };
    if (extraction_.is_midpoint) {  // all middles are as near to the one end as to the other
      const CornerWords signs = row.corners(w);
      find([&](unsigned a, unsigned /*b*/) { return signs[a]; });
      return first;
    }
    std::array<const std::byte*, 4> near;  // from (y, z), (y + 1, z), ... on
    for (unsigned r = 0; r < 4; ++r) near[r] = nearness(w, y + (r & 1), z + (r >> 1));
    with_rank(nearness_.rank_bytes(), [&](auto rank) {
      using Rank = decltype(rank);
      const auto at = [&](unsigned corner) {
        return reinterpret_cast<const Rank*>(near[corner >> 1]) + (corner & 1);
      };
      find([&](unsigned a, unsigned b) { return less(at(a), at(b)); });
    });
    return first;
  }

  // Beyond the last rows there is no edge to compare.
  const std::byte* nearness(std::size_t w, std::uint32_t y, std::uint32_t z) {
    return nearness_.from(w, std::min(y, last_y_), std::min(z, last_z_));
  }

  const Extraction& extraction_;
  const Links& links_;
  const std::size_t words_;
  const std::uint32_t last_y_;
  const std::uint32_t last_z_;
  SignField field_;
  NearnessPlanes nearness_;
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
