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
    if (end_ - out > static_cast<std::ptrdiff_t>(kMostTriangles)) return keep(cell, places, out);
    std::array<Triangle, kMostTriangles + 1> all;
    const Triangle* last = keep(cell, places, all.data());
    return std::copy(static_cast<const Triangle*>(all.data()), last, out);
  }

 private:
  // One more than is kept may be written. No branch tells which those are: none could be foreseen.
  HWY_INLINE Triangle* keep(const CellCase& cell, const std::uint32_t* places,
                            Triangle* out) const {
    for (std::size_t t = 0; t < cell.triangles; ++t) {
      const auto& [first, second, third] = cell.edges[t];
      const std::uint32_t a = places[offsets_[first]];
      const std::uint32_t b = places[offsets_[second]];
      const std::uint32_t c = places[offsets_[third]];
      *out = {a, b, c};
      out += static_cast<unsigned>(a != b) & static_cast<unsigned>(b != c) &
             static_cast<unsigned>(c != a);
    }
    return out;
  }

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
        rows_(std::size_t{dims_.y} + 2),
        joined_(rows_ * dims_.x),
        next_row_(std::size_t{first} * dims_.y),
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
        steps_[d] = {static_cast<std::uint8_t>(direction.corner >> 1),
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
    return {SignField::row(y, z), &joined_[joined_row(std::size_t{z} * dims_.y + y)]};
  }

  RegularCellWriter cell_writer(std::uint32_t y, std::uint32_t z, const EdgeOffsets& offsets,
                                Mesh& mesh) const {
    return {extraction_.splits, SignField::row(y, z), offsets,
            mesh.triangles.data() + mesh.layer_triangles[z + 1]};
  }

  // Gives the clusters of a row the vertices from `vertex` on and writes those to the edges that
  // are joined; `rows` are the indices of the samples of the rows (y, z), (y - 1, z), (y, z - 1)
  // and (y - 1, z - 1). Places the vertices unless `positions` is null. Returns the vertex behind
  // them. Afterwards row(y, z) can be asked for. To be called row by row.
  std::uint32_t number_clusters(std::uint32_t y, std::uint32_t z,
                                const std::array<std::uint32_t*, 4>& rows, std::uint32_t vertex,
                                Vec3* positions) {
    mark_joined(y, z);
    std::uint32_t* edge = edges_.data();
    std::uint8_t* size = sizes_.data();
    visit_clusters(y, z, [&](std::size_t x, Directions joined) {
      const bool is_one = (joined & JoiningSample::kSeveral) == 0;
      joined &= ~JoiningSample::kSeveral;
      while (joined != 0) {
        const Directions component =
            is_one ? joined : links_.facts(extraction_.parity(x, y, z), joined).first();
        joined &= ~component;
        *size++ = static_cast<std::uint8_t>(std::popcount(component));
        for (Directions rest = component; rest != 0; rest &= rest - 1) {
          const auto d = static_cast<unsigned>(std::countr_zero(rest));
          const Step& step = steps_[d];
          rows[step.row][(x - step.before) * kEdgePlaces + step.place] = vertex;
          *edge++ = static_cast<std::uint32_t>(x) * kClusterPlaces + d;
        }
        ++vertex;
      }
    });
    clusters_ = static_cast<std::size_t>(size - sizes_.data());
    if (positions != nullptr && clusters_ != 0) {
      place_clusters(y, z, {edges_.data(), edge}, positions);
    }
    return vertex;
  }

 private:
  static constexpr std::uint32_t kClusterPlaces = 32;  // a sample, for its directions

  // Where the edge of a direction is: in which of the rows (y, z), (y - 1, z), (y, z - 1) and
  // (y - 1, z - 1), how many samples before, and its own direction.
  struct Step {
    std::uint8_t row = 0;
    std::uint8_t before = 0;
    std::uint8_t place = 0;
  };

  // Marks what the clusters of the rows around (y, z) join: the rest of the edges of that row then
  // have vertices of their own.
  void mark_joined(std::uint32_t y, std::uint32_t z) {
    const std::size_t last = std::size_t{z + 1} * dims_.y + y + 1;
    for (; next_row_ <= last; ++next_row_) {
      std::uint8_t* here = &joined_[joined_row(next_row_)];
      std::fill_n(here, dims_.x, std::uint8_t{0});
      const auto row_z = static_cast<std::uint32_t>(next_row_ / dims_.y);
      const auto row_y = static_cast<std::uint32_t>(next_row_ % dims_.y);
      visit_clusters(row_y, row_z, [&](std::size_t x, Directions joined) {
        const std::array<std::uint8_t*, 4> rows = {here, &joined_[joined_row(next_row_ - 1)],
                                                   &joined_[joined_row(next_row_ - dims_.y)],
                                                   &joined_[joined_row(next_row_ - dims_.y - 1)]};
        for (Directions rest = joined & ~JoiningSample::kSeveral; rest != 0; rest &= rest - 1) {
          const Step& step = steps_[static_cast<unsigned>(std::countr_zero(rest))];
          std::uint8_t& edges = rows[step.row][x - step.before];
          edges = static_cast<std::uint8_t>(edges | 1U << step.place);
        }
      });
    }
  }

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

  // Calls visit(x, the directions in which it joins crossings) for the samples of a row.
  template <class Visit>
  void visit_clusters(std::uint32_t y, std::uint32_t z, Visit visit) const {
    if (z >= extraction_.clusters.size() || extraction_.clusters[z].samples.empty()) return;
    const ClusterLayer& layer = extraction_.clusters[z];
    for (std::uint32_t i = layer.row_begin[y]; i < layer.row_begin[y + 1]; ++i) {
      visit(std::size_t{layer.samples[i].x}, layer.samples[i].directions);
    }
  }

  std::size_t joined_row(std::size_t row) const { return row % rows_ * dims_.x; }

  const Extraction& extraction_;
  const Dims dims_;
  const Links& links_;
  const std::size_t rows_;
  std::vector<std::uint8_t> joined_;  // of each sample of the last rows that were marked
  std::size_t next_row_;              // the first that is not
  std::array<EdgeSamples, std::size_t{2}* kClusterPlaces> ends_ = {};  // by parity and direction
  std::array<EdgeFrame, std::size_t{2}* kClusterPlaces> frames_ = {};
  std::array<Step, kMostDirections> steps_ = {};
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
