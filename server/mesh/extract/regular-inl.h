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
  RegularCellWriter(const SignCellWriter& writer, const Triangle* end)
      : writer_(writer), end_(end) {}

  HWY_INLINE Triangle* write(std::size_t x, unsigned bit, const SignCells& cells,
                             const std::uint32_t* places, Triangle* out) const {
    if (end_ - out >= static_cast<std::ptrdiff_t>(kMostTriangles)) {
      return keep(writer_.write(x, bit, cells, places, out), out);
    }
    std::array<Triangle, kMostTriangles> all;
    const Triangle* last = keep(writer_.write(x, bit, cells, places, all.data()), all.data());
    return std::copy(static_cast<const Triangle*>(all.data()), last, out);
  }

 private:
  HWY_INLINE static Triangle* keep(const Triangle* end, Triangle* out) {
    for (const Triangle* next = out; next != end; ++next) {
      const Triangle triangle = *next;
      *out = triangle;
      const auto& [a, b, c] = triangle;
      out += a != b && b != c && c != a ? 1 : 0;
    }
    return out;
  }

  const SignCellWriter writer_;
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
        words_(words_of(dims_.x)),
        rows_(std::size_t{dims_.y} + 2),
        joined_(rows_ * dims_.x),
        next_row_(std::size_t{first} * dims_.y) {
    const auto directions = links_.directions();
    for (unsigned parity = 0; parity < 2; ++parity) {
      for (std::size_t d = 0; d < directions.size(); ++d) {
        const LinkDirection& direction = directions[d];
        // As the edge's owner names it, for the same bits.
        const unsigned owner = parity ^ (std::popcount(direction.corner) & 1U);
        const EdgeEnds ends = extraction.splits[owner].ends[direction.place];
        const std::ptrdiff_t to_owner = -sample_offset(extraction.inner, direction.corner);
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
    return {SignField::cell_writer(y, z, offsets, mesh),
            mesh.triangles.data() + mesh.layer_triangles[z + 1]};
  }

  // Gives the clusters of a row the vertices from `vertex` on and writes those to the edges that
  // are joined; `rows` are the indices of the samples of the rows (y, z), (y - 1, z), (y, z - 1) and
  // (y - 1, z - 1). Places the vertices unless `positions` is null. Returns the vertex behind them.
  // Afterwards row(y, z) can be asked for. To be called row by row.
  std::uint32_t number_clusters(std::uint32_t y, std::uint32_t z,
                                const std::array<std::uint32_t*, 4>& rows, std::uint32_t vertex,
                                Vec3* positions) {
    mark_joined(y, z);
    edges_.clear();
    sizes_.clear();
    const auto directions = links_.directions();
    visit_clusters(y, z, [&](std::size_t x, Directions joined) {
      const unsigned parity = extraction_.parity(x, y, z);
      while (joined != 0) {
        const Directions component = links_.facts(parity, joined).first();
        joined &= ~component;
        for (Directions rest = component; rest != 0; rest &= rest - 1) {
          const auto d = static_cast<std::size_t>(std::countr_zero(rest));
          const LinkDirection& direction = directions[d];
          const std::size_t owner = x - (direction.corner & 1U);
          rows[direction.corner >> 1][owner * kEdgePlaces + direction.place] = vertex;
          edges_.push_back(static_cast<std::uint32_t>(x * kClusterPlaces + d));
        }
        sizes_.push_back(static_cast<std::uint8_t>(std::popcount(component)));
        ++vertex;
      }
    });
    if (positions != nullptr && !sizes_.empty()) place_clusters(y, z, positions);
    return vertex;
  }

 private:
  static constexpr std::uint32_t kClusterPlaces = 32;  // a sample, for its directions

  // Marks what the clusters of the rows around (y, z) join: the rest of the edges of that row then
  // have vertices of their own.
  void mark_joined(std::uint32_t y, std::uint32_t z) {
    const std::size_t last = std::size_t{z + 1} * dims_.y + y + 1;
    const auto directions = links_.directions();
    for (; next_row_ <= last; ++next_row_) {
      std::uint8_t* here = &joined_[joined_row(next_row_)];
      std::fill_n(here, dims_.x, std::uint8_t{0});
      const auto row_z = static_cast<std::uint32_t>(next_row_ / dims_.y);
      const auto row_y = static_cast<std::uint32_t>(next_row_ % dims_.y);
      visit_clusters(row_y, row_z, [&](std::size_t x, Directions joined) {
        const std::array<std::uint8_t*, 4> rows = {
            here, &joined_[joined_row(next_row_ - 1)], &joined_[joined_row(next_row_ - dims_.y)],
            &joined_[joined_row(next_row_ - dims_.y - 1)]};
        for (Directions rest = joined; rest != 0; rest &= rest - 1) {
          const auto& direction = directions[static_cast<std::size_t>(std::countr_zero(rest))];
          std::uint8_t& edges = rows[direction.corner >> 1][x - (direction.corner & 1U)];
          edges = static_cast<std::uint8_t>(edges | 1U << direction.place);
        }
      });
    }
  }

  // The means of the crossings of each cluster, whose edges are edges_.
  void place_clusters(std::uint32_t y, std::uint32_t z, Vec3* out) {
    const std::uint32_t margin = extraction_.margin;
    shares_.resize(std::max(shares_.size(), edges_.size()));
    extraction_.samples->shares({y - margin, z - margin, margin, kClusterPlaces,
                                 extraction_.parity(0, y, z), ends_.data(), edges_},
                                shares_.data());
    const LatticeToSpace& map = extraction_.to_space;
    const Double4 row_at =
        lanes(map.origin) + lanes(map.step_y) * (y - margin) + lanes(map.step_z) * (z - margin);
    std::size_t edge = 0;
    for (const unsigned size : sizes_) {
      const std::uint32_t x = edges_[edge] / kClusterPlaces;
      const EdgeFrame* frames = &frames_[extraction_.parity(x, y, z) * kClusterPlaces];
      Double4 sum = {};
      for (const std::size_t end = edge + size; edge < end; ++edge) {
        const EdgeFrame& frame = frames[edges_[edge] % kClusterPlaces];
        sum += frame.start + frame.run * shares_[edge];
      }
      const Double4 at = row_at + lanes(map.step_x) * static_cast<double>(x - margin);
      const Float4 position = __builtin_convertvector(at + sum / static_cast<double>(size), Float4);
      std::memcpy(out++, &position, sizeof *out);
    }
  }

  // Calls visit(x, the directions in which it joins crossings) for the samples of a row.
  template <class Visit>
  void visit_clusters(std::uint32_t y, std::uint32_t z, Visit visit) const {
    if (z >= extraction_.clusters.size() || extraction_.clusters[z].directions.empty()) return;
    const ClusterLayer& layer = extraction_.clusters[z];
    const Directions* joined = layer.directions.data() + layer.row_begin[y];
    for (std::size_t w = 0; w < words_; ++w) {
      for (Word rest = layer.samples[y * words_ + w]; rest != 0; rest &= rest - 1) {
        visit(w * kWordBits + static_cast<unsigned>(std::countr_zero(rest)), *joined++);
      }
    }
  }

  std::size_t joined_row(std::size_t row) const { return row % rows_ * dims_.x; }

  const Extraction& extraction_;
  const Dims dims_;
  const Links& links_;
  const std::size_t words_;
  const std::size_t rows_;
  std::vector<std::uint8_t> joined_;  // of each sample of the last rows that were marked
  std::size_t next_row_;              // the first that is not
  std::array<EdgeSamples, std::size_t{2} * kClusterPlaces> ends_ = {};  // by parity and direction
  std::array<EdgeFrame, std::size_t{2} * kClusterPlaces> frames_ = {};
  // Of the row that is numbered: the edges of its clusters, one after the other, as
  // kClusterPlaces * x + direction, and how many each has.
  std::vector<std::uint32_t> edges_;
  std::vector<std::uint8_t> sizes_;
  std::vector<double> shares_;
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
