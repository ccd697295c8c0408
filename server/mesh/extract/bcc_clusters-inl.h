// The rule of the walk over clusters for the body-centred lattice: samples and centres are points
// with fourteen neighbours each, and a crossing belongs to the end whose value is nearer to the
// iso-value. Compiled once for each instruction set, see slabs.cpp.
#if defined(ISOMESH_BCC_CLUSTERS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_BCC_CLUSTERS_INL_H_
#undef ISOMESH_BCC_CLUSTERS_INL_H_
#else
#define ISOMESH_BCC_CLUSTERS_INL_H_
#endif

#include <array>
#include <cstddef>
#include <cstdint>

#include <hwy/highway.h>

#include "server/mesh/extract/bcc_field-inl.h"
#include "server/mesh/extract/bcc_signs-inl.h"
#include "server/mesh/extract/clusters-inl.h"
#include "server/mesh/extract/links.h"
#include "server/mesh/extract/sign_clusters-inl.h"
#include "server/mesh/extract/slabs.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

class BccClusters {
 public:
  using Marched = Extraction;
  static constexpr std::uint32_t kKinds = 2;
  static constexpr std::size_t kPlaces = kBccDiagonalSlot;

  static LinksOfKinds<2> links(const Extraction& extraction) { return BccField::links(extraction); }

  BccClusters(const Extraction& extraction, std::uint32_t first)
      : extraction_(extraction),
        links_(links(extraction)),
        words_(words_of(extraction.dims.x)),
        field_(extraction, first),
        samples_(extraction, BccPoint::kSample),
        centres_(extraction, BccPoint::kCentre) {}

  void reach(std::uint32_t z) { field_.reach(z); }
  void open(std::uint32_t z) {
    samples_.open(z);
    centres_.open(z);
  }

  WordCount split_edges(std::size_t w, std::uint32_t y, std::uint32_t z, EdgeWords<kPlaces>& out) {
    out.any = 0;
    const BccRow row = field_.row(y, z);
    if (!row.may_cross(w)) return {};
    const CornerWords corners = row.corners(w);
    auto crossed = row.crossed_edges(w, corners);
    const WordCount count = {count_bits(crossed), row.count_triangles(w, corners)};
    // Cells with a phantom have no centre, and none of their points joins crossings.
    crossed[0] &= ~row.split_in_six(w);
    for (std::size_t slot = 0; slot < kPlaces; ++slot) out.any |= crossed[slot];
    if (out.any == 0) return count;
    if (extraction_.is_midpoint) {  // all middles are as near to the one end as to the other
      split(
          crossed,
          [&](std::size_t slot) {
            return slot >= kBccAxisSlot && slot < kBccCentreSlot ? corners[0] : row.centre(w);
          },
          out);
      return count;
    }
    with_rank(samples_.rank_bytes(), [&](auto rank) {
      using Rank = decltype(rank);
      const auto at = [&](NearnessPlanes& points, unsigned corner) {
        const std::byte* near = points.from(w, y + (corner >> 1 & 1), z + (corner >> 2));
        return reinterpret_cast<const Rank*>(near) + (corner & 1);
      };
      split(
          crossed,
          [&](unsigned slot) {
            if (slot < kBccAxisSlot) return less(at(centres_, 0), at(samples_, slot));
            if (slot >= kBccCentreSlot) {
              return less(at(centres_, 0), at(centres_, 1U << (slot - kBccCentreSlot)));
            }
            return less(at(samples_, 0), at(samples_, 1U << (slot - kBccAxisSlot)));
          },
          out);
    });
    return count;
  }

  template <class Crossed>
  Directions candidates(const GridSample& at, Directions own, Crossed crossed) const {
    return components_to_join(*links_[at.kind], 0, own, crossed);
  }

  // Points on two sides share no crossing.
  Word may_clash(std::size_t w, const GridSample& at, const GridSample& to, int step) const {
    return ~(signs(at)[w] ^ bits_beside(signs(to), w, words_, step));
  }

  Directions clashing(const GridSample& at, std::size_t direction, const GridSample& /*to*/,
                      Directions mine, Directions theirs) const {
    return links_[at.kind]->clashing(0, direction, mine, theirs);
  }

  ClusterLoss loss(const GridSample& at, Joined kept, const ClusterFacts& facts,
                   ClusterLayer& /*layer*/) const {
    return loss_of_components(*links_[at.kind], kept.directions(), facts);
  }

 private:
  // Gives each crossed edge to one of its ends. `first_ends(slot)`: the records whose edge of the
  // slot belongs to its first end.
  template <class FirstEnds>
  HWY_INLINE static void split(const std::array<Word, kBccSlots>& crossed, FirstEnds first_ends,
                               EdgeWords<kPlaces>& out) {
    for (unsigned slot = 0; slot < kPlaces; ++slot) {
      const Word first = crossed[slot] == 0 ? 0 : crossed[slot] & first_ends(slot);
      out.first[slot] = first;
      out.second[slot] = crossed[slot] & ~first;
    }
  }

  const Word* signs(const GridSample& at) const {
    return field_.signs(static_cast<BccPoint>(at.kind), at.y, at.z);
  }

  const Extraction& extraction_;
  const LinksOfKinds<kKinds> links_;
  const std::size_t words_;
  BccField field_;
  NearnessPlanes samples_;
  NearnessPlanes centres_;
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
