// What the walk is told of an iso-value's signs where the surface is regularised: each row has the
// vertices of its clusters before those of the edges that no cluster has. Compiled once for each
// instruction set, see slabs.cpp.
#if defined(ISOMESH_REGULAR_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_REGULAR_INL_H_
#undef ISOMESH_REGULAR_INL_H_
#else
#define ISOMESH_REGULAR_INL_H_
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include <hwy/highway.h>

#include "server/mesh/extract/joined_rows-inl.h"
#include "server/mesh/extract/links.h"
#include "server/mesh/extract/signs-inl.h"
#include "server/mesh/extract/slabs.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

// A row without the vertices that clusters have instead of its edges.
class RegularRow : public SignRow {
 public:
  // `joined`: for each sample the set of its edges, by direction, that are some cluster's.
  RegularRow(const SignRow& row, const std::uint8_t* joined) : SignRow(row), joined_(joined) {}

  HWY_INLINE std::uint32_t* list(std::size_t x, unsigned bit, const SignCells& cells,
                                 std::uint32_t* next) const {
    return list_edges(x, directions(x, bit, cells) & ~unsigned{joined_[x]}, next);
  }

 private:
  const std::uint8_t* joined_;
};

// Leaves triangles out of which two corners are one vertex.
class RegularCellWriter {
 public:
  // `end`: where the layer's triangles end, beyond which nothing may be written.
  RegularCellWriter(const std::array<CellSplit, 2>& splits, const SignRow& row,
                    const EdgeOffsets& offsets, const Triangle* end)
      : splits_(splits), row_(row), offsets_(offsets), end_(end) {}

  HWY_INLINE Triangle* write(std::size_t x, unsigned bit, const SignCells& cells,
                             const std::uint32_t* places, Triangle* out) const {
    const CellCase& cell = splits_[row_.parity_at(x)].cases[cells.cases[bit]];
    return write_kept(cell, places, offsets_, end_, out);
  }

 private:
  const std::array<CellSplit, 2>& splits_;
  const SignRow row_;
  const EdgeOffsets& offsets_;
  const Triangle* end_;
};

class RegularField : public SignField {
 public:
  using Row = RegularRow;
  static constexpr bool kHasClusters = true;

  RegularField(const Extraction& extraction, std::uint32_t first)
      : SignField(extraction, first),
        extraction_(extraction),
        dims_(extraction.dims),
        links_(links_of(extraction.scheme)),
        joined_(dims_, first),
        edges_(std::size_t{dims_.x} * kMostDirections),
        sizes_(edges_.size()) {
    const auto directions = links_.directions();
    for (unsigned parity = 0; parity < 2; ++parity) {
      for (std::size_t d = 0; d < directions.size(); ++d) {
        const LinkDirection& direction = directions[d];
        // As the edge's owner names it, for the same bits.
        const unsigned owner = parity ^ (std::popcount(direction.corner) & 1U);
        const EdgeEnds ends = extraction.splits[owner].ends[direction.place];
        const std::ptrdiff_t to_owner = -sample_offset(extraction.inner, direction.corner);
        names_[d] = {static_cast<std::uint8_t>(direction.corner >> 1),
                     static_cast<std::uint8_t>(direction.corner & 1), direction.place};
        const std::size_t place = parity * kClusterPlaces + d;
        ends_[place] = {to_owner + sample_offset(extraction.inner, ends.from),
                        to_owner + sample_offset(extraction.inner, ends.to)};
        frames_[place] = SignField::frame(owner, direction.place);
        frames_[place].start -= space_offset(extraction.to_space, direction.corner);
      }
    }
  }

  RegularRow row(std::uint32_t y, std::uint32_t z) const {
    return {SignField::row(y, z), joined_.row(y, z)};
  }

  RegularCellWriter cell_writer(std::uint32_t y, std::uint32_t z, const EdgeOffsets& offsets,
                                Mesh& mesh) const {
    return {extraction_.splits, SignField::row(y, z), offsets,
            mesh.triangles.data() + mesh.layer_triangles[z + 1]};
  }

  // Gives the clusters of a row the vertices from `vertex` on and writes those to the edges that
  // are joined; `rows` are the indices of the samples of the rows (y, z), (y - 1, z), (y, z - 1)
  // and (y - 1, z - 1). Places the vertices in `mesh` unless it is null. Returns the vertex behind
  // them. Afterwards row(y, z) can be asked for. To be called row by row.
  std::uint32_t number_clusters(std::uint32_t y, std::uint32_t z,
                                const std::array<std::uint32_t*, 4>& rows, std::uint32_t vertex,
                                Mesh* mesh) {
    joined_.mark(extraction_.clusters, y, z,
                 [&](const JoiningSample& sample, std::uint32_t /*y*/, std::uint32_t /*z*/,
                     const JoinedPoints* /*none*/, auto visit) {
                   for (Directions rest = sample.directions & ~JoiningSample::kFlags; rest != 0;
                        rest &= rest - 1) {
                     visit(names_[static_cast<unsigned>(std::countr_zero(rest))]);
                   }
                 });
    const std::uint32_t first = vertex;
    std::uint32_t* edge = edges_.data();
    std::uint8_t* size = sizes_.data();
    visit_joining(
        extraction_.clusters, y, z, [&](const JoiningSample& sample, const JoinedPoints* /*none*/) {
          const std::size_t x = sample.x;
          const bool is_one = (sample.directions & JoiningSample::kSeveral) == 0;
          Directions joined = sample.directions & ~JoiningSample::kFlags;
          while (joined != 0) {
            const Directions component =
                is_one ? joined : links_.facts(extraction_.parity(x, y, z), joined).first();
            joined &= ~component;
            *size++ = static_cast<std::uint8_t>(std::popcount(component));
            for (Directions rest = component; rest != 0; rest &= rest - 1) {
              const auto d = static_cast<unsigned>(std::countr_zero(rest));
              const JoinedName& name = names_[d];
              rows[name.row][(x - name.before) * kEdgePlaces + name.place] = vertex;
              *edge++ = static_cast<std::uint32_t>(x) * kClusterPlaces + d;
            }
            ++vertex;
          }
        });
    clusters_ = static_cast<std::size_t>(size - sizes_.data());
    if (mesh != nullptr && clusters_ != 0) {
      place_clusters(y, z, {edges_.data(), edge}, mesh->positions.data() + first);
    }
    return vertex;
  }

 private:
  static constexpr std::uint32_t kClusterPlaces = 32;  // a sample, for its directions

  // The means of the crossings of each cluster.
  void place_clusters(std::uint32_t y, std::uint32_t z, std::span<const std::uint32_t> edges,
                      Vec3* out) {
    const std::uint32_t margin = extraction_.margin;
    shares_.resize(std::max(shares_.size(), edges.size()));
    extraction_.samples->shares({y - margin, z - margin, margin, kClusterPlaces,
                                 extraction_.parity(0, y, z), ends_.data(), edges},
                                shares_.data());
    const LatticeToSpace& map = extraction_.to_space;
    const Double4 row_at =
        lanes(map.origin) + lanes(map.step_y) * (y - margin) + lanes(map.step_z) * (z - margin);
    std::size_t edge = 0;
    for (std::size_t cluster = 0; cluster < clusters_; ++cluster) {
      const std::uint32_t x = edges[edge] / kClusterPlaces;
      const EdgeFrame* frames = &frames_[extraction_.parity(x, y, z) * kClusterPlaces];
      Double4 sum = {};
      for (const std::size_t end = edge + sizes_[cluster]; edge < end; ++edge) {
        const EdgeFrame& frame = frames[edges[edge] % kClusterPlaces];
        sum += frame.start + frame.run * shares_[edge];
      }
      const Double4 at = row_at + lanes(map.step_x) * static_cast<double>(x - margin);
      const Float4 position =
          __builtin_convertvector(at + sum / static_cast<double>(sizes_[cluster]), Float4);
      std::memcpy(out++, &position, sizeof *out);
    }
  }

  const Extraction& extraction_;
  const Dims dims_;
  const Links& links_;
  JoinedRows<std::uint8_t> joined_;
  std::array<EdgeSamples, std::size_t{2}* kClusterPlaces> ends_ = {};  // by parity and direction
  std::array<EdgeFrame, std::size_t{2}* kClusterPlaces> frames_ = {};
  std::array<JoinedName, kMostDirections> names_ = {};
  // Of the row that is numbered: the edges of its clusters, one after the other, as
  // kClusterPlaces * x + direction, and how many each has.
  std::vector<std::uint32_t> edges_;
  std::vector<std::uint8_t> sizes_;
  std::size_t clusters_ = 0;
  std::vector<double> shares_;
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
