// The vertices of the clusters of a surface on the body-centred lattice that is regularised, which
// come before those of each row's other edges. Compiled once for each instruction set, see
// slabs.cpp.
#if defined(ISOMESH_BCC_REGULAR_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_BCC_REGULAR_INL_H_
#undef ISOMESH_BCC_REGULAR_INL_H_
#else
#define ISOMESH_BCC_REGULAR_INL_H_
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include <hwy/highway.h>

#include "server/mesh/extract/bcc_walk-inl.h"
#include "server/mesh/extract/joined_rows-inl.h"
#include "server/mesh/extract/links.h"
#include "server/mesh/extract/slabs.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

// A sample's record in a numbered row: the index of the vertex of each slot.
struct BccIndices {
  static constexpr std::size_t kPlaces = kRegularBccPlaces;
  static_assert(kPlaces == kBccSlots);

  HWY_INLINE static void write(std::uint32_t* numbers, unsigned slots, std::uint32_t first) {
    for (; slots != 0; slots &= slots - 1) numbers[std::countr_zero(slots)] = first++;
  }
  HWY_INLINE static std::uint32_t index(const std::uint32_t* numbers, unsigned slot) {
    return numbers[slot];
  }
};

class BccRegular {
 public:
  using Numbers = BccIndices;
  static constexpr bool kHasClusters = true;

  BccRegular(const Extraction& extraction, std::uint32_t first)
      : extraction_(extraction), joined_(extraction.dims, first) {
    const auto frames = bcc_frames(extraction.to_space);
    for (std::size_t kind = 0; kind < kKinds; ++kind) {
      const auto directions = links_of(static_cast<BccPoint>(kind)).directions();
      for (std::size_t d = 0; d < directions.size(); ++d) {
        const LinkDirection& direction = directions[d];
        names_[kind][d] = {static_cast<std::uint8_t>(direction.corner >> 1),
                           static_cast<std::uint8_t>(direction.corner & 1), direction.place};
        frames_[kind][d] = frames[direction.place];
        frames_[kind][d].start -= space_offset(extraction.to_space, direction.corner);
      }
    }
  }

  // For each sample of the row the slots whose edges some cluster has, after number_clusters.
  const std::uint32_t* row(std::uint32_t y, std::uint32_t z) const { return joined_.row(y, z); }

  // Like RegularField::number_clusters; `rows` hold the numbers of the samples.
  std::uint32_t number_clusters(std::uint32_t y, std::uint32_t z,
                                const std::array<std::uint32_t*, 4>& rows, std::uint32_t vertex,
                                Mesh* mesh) {
    joined_.mark(extraction_.clusters, y, z,
                 [&](const JoiningPlace& at, const Joined& joined, const JoinedPoints* /*none*/,
                     auto visit) {
                   for (Directions rest = joined.directions(); rest != 0; rest &= rest - 1) {
                     visit(names_[at.row % kKinds][static_cast<unsigned>(std::countr_zero(rest))]);
                   }
                 });
    const std::uint32_t first = vertex;
    clusters_.clear();
    for (auto& edges : edges_) edges.clear();
    for (std::uint32_t kind = 0; kind < kKinds; ++kind) {
      const Links& links = links_of(static_cast<BccPoint>(kind));
      visit_joining(extraction_.clusters, y * kKinds + kind, z,
                    [&](std::uint32_t x, const Joined& all, const JoinedPoints* /*none*/) {
                      const bool is_one = all.is_one();
                      Directions joined = all.directions();
                      while (joined != 0) {
                        const Directions component =
                            is_one ? joined : links.facts(0, joined).first();
                        joined &= ~component;
                        add_cluster({x, kind, component}, rows, vertex++);
                      }
                    });
    }
    if (mesh != nullptr && !clusters_.empty()) place(y, z, mesh->positions.data() + first);
    return vertex;
  }

 private:
  static constexpr std::uint32_t kKinds = 2;  // samples and centres, as BccPoint

  struct Cluster {
    std::uint32_t x = 0;
    std::uint32_t kind = 0;
    Directions directions = 0;
  };

  void add_cluster(const Cluster& cluster, const std::array<std::uint32_t*, 4>& rows,
                   std::uint32_t vertex) {
    clusters_.push_back(cluster);
    for (Directions rest = cluster.directions; rest != 0; rest &= rest - 1) {
      const auto& name = names_[cluster.kind][static_cast<unsigned>(std::countr_zero(rest))];
      const std::uint32_t x = cluster.x - name.before;
      rows[name.row][x * BccIndices::kPlaces + name.place] = vertex;
      edges_[name.row].push_back(x * kBccSlotRange + name.place);
    }
  }

  // The means of the crossings of each cluster.
  void place(std::uint32_t y, std::uint32_t z, Vec3* out) {
    const std::uint32_t margin = extraction_.margin;
    std::array<const double*, 4> share;
    for (std::uint32_t r = 0; r < 4; ++r) {
      shares_[r].resize(std::max(shares_[r].size(), edges_[r].size()));
      share[r] = shares_[r].data();
      if (edges_[r].empty()) continue;
      extraction_.samples->bcc_shares(
          {y - margin - (r & 1), z - margin - (r >> 1), margin, edges_[r]}, shares_[r].data());
    }
    const LatticeToSpace& map = extraction_.to_space;
    const Double4 row_at = row_origin(map, y - margin, z - margin);
    for (const Cluster& cluster : clusters_) {
      Double4 sum = {};
      for (Directions rest = cluster.directions; rest != 0; rest &= rest - 1) {
        const auto d = static_cast<unsigned>(std::countr_zero(rest));
        const EdgeFrame& frame = frames_[cluster.kind][d];
        sum += frame.start + frame.run * *share[names_[cluster.kind][d].row]++;
      }
      const Double4 at = row_at + lanes(map.step_x) * static_cast<double>(cluster.x - margin);
      const Float4 position = __builtin_convertvector(
          at + sum / static_cast<double>(std::popcount(cluster.directions)), Float4);
      std::memcpy(out++, &position, sizeof *out);
    }
  }

  const Extraction& extraction_;
  JoinedRows<std::uint32_t, kKinds> joined_;
  std::array<std::array<JoinedName, kMostDirections>, kKinds> names_ = {};
  std::array<std::array<EdgeFrame, kMostDirections>, kKinds> frames_ = {};
  // The clusters of the row that is numbered, and their edges by the row that owns those, each as
  // kBccSlotRange * x + slot.
  std::vector<Cluster> clusters_;
  std::array<std::vector<std::uint32_t>, 4> edges_;
  std::array<std::vector<double>, 4> shares_;
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
