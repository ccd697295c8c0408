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
#include <limits>
#include <span>
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
    const bool is_centre = point_ == BccPoint::kCentre;
    const std::uint32_t less = is_centre ? 1 : 0;
    const Dims inner = {extraction_.inner.x - less, extraction_.inner.y - less,
                        extraction_.inner.z - less};
    if (y - margin >= inner.y || z - margin >= inner.z) return;  // before the first, it wraps
    const std::size_t begin = std::max<std::size_t>(w * kWordBits, margin);
    const std::size_t end = std::min<std::size_t>((w + 1) * kWordBits, inner.x + margin);
    if (begin >= end) return;
    const auto first = static_cast<std::uint32_t>(begin - margin);
    const std::span found(out + (begin - w * kWordBits), end - begin);
    is_centre ? extraction_.samples->centre_nearness(y - margin, z - margin, first, found)
              : extraction_.samples->nearness(y - margin, z - margin, first, found);
  }

  const Extraction& extraction_;
  const BccPoint point_;
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

class SignClusters {
 public:
  using Marched = Extraction;

  SignClusters(const Extraction& extraction, std::uint32_t first)
      : extraction_(extraction),
        links_(links_of(extraction.scheme)),
        last_y_(extraction.dims.y - 1),
        last_z_(extraction.dims.z - 1),
        field_(extraction, first),
        nearness_(extraction) {}

  void reach(std::uint32_t z) { field_.reach(z); }
  void open(std::uint32_t z) { nearness_.open(z); }

  WordCount split_edges(std::size_t w, std::uint32_t y, std::uint32_t z, EdgeWords& out) {
    out.any = 0;
    const SignRow row = field_.row(y, z);
    if (!row.may_cross(w)) return {};
    const CornerWords signs = row.corners(w);
    WordCount count = {.vertices = 0, .triangles = row.count_triangles(w, signs)};
    const std::array<Word, 8> crossed = row.crossed_edges(w, signs);
    for (const Word all : crossed) out.any |= all;
    if (out.any == 0) return count;
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
      out.first[direction] = first;
      out.second[direction] = all & ~first;
      count.vertices += static_cast<unsigned>(std::popcount(all));
    }
    return count;
  }

  Directions candidates(const GridSample& at, const Star& star) const {
    return components_to_join(links_, extraction_.parity(at.x, at.y, at.z), star);
  }

  // Samples on two sides share no crossing.
  Directions clashing(const GridSample& at, std::size_t direction, const GridSample& to,
                      Directions mine, Directions theirs) const {
    if (is_inside(at) != is_inside(to)) return 0;
    return links_.clashing(extraction_.parity(at.x, at.y, at.z), direction, mine, theirs);
  }

  ClusterLoss loss(const GridSample& /*at*/, Directions kept, const ClusterFacts& facts,
                   ClusterLayer& /*layer*/) const {
    return loss_of_components(links_, kept & ~JoiningSample::kFlags, facts);
  }

 private:
  // Beyond the last rows there is no edge to compare.
  const std::int32_t* nearness(std::size_t w, std::uint32_t y, std::uint32_t z) {
    return nearness_.from(w, std::min(y, last_y_), std::min(z, last_z_));
  }

  bool is_inside(const GridSample& at) const {
    return (field_.signs(at.y, at.z)[at.x / kWordBits] >> (at.x % kWordBits) & 1) != 0;
  }

  const Extraction& extraction_;
  const Links& links_;
  const std::uint32_t last_y_;
  const std::uint32_t last_z_;
  SignField field_;
  NearnessPlanes nearness_;
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
