// The samples' signs (set: inside), one bit each, and the logic on 64 samples at a time by which
// extraction at an iso-value counts and walks. Compiled once for each instruction set, see
// slabs.cpp.
#if defined(ISOMESH_SIGNS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_SIGNS_INL_H_
#undef ISOMESH_SIGNS_INL_H_
#else
#define ISOMESH_SIGNS_INL_H_
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <hwy/highway.h>

#include "server/mesh/extract/links.h"
#include "server/mesh/extract/slabs.h"
#include "server/mesh/lattice/rows-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

// The signs of one plane of samples. Each row ends in one word of zeros, so that the word after a
// row's last one can be read.
class SignPlane {
 public:
  explicit SignPlane(const Dims& dims) : words_(words_of(dims.x)), bits_((words_ + 1) * dims.y) {}

  std::size_t words() const { return words_; }
  Word* row(std::size_t y) { return bits_.data() + y * (words_ + 1); }
  const Word* row(std::size_t y) const { return bits_.data() + y * (words_ + 1); }

 private:
  std::size_t words_;
  std::vector<Word> bits_;
};

// Fills `plane` with the signs of the samples of plane z, phantoms included, which are outside.
inline void classify(const Extraction& extraction, std::uint32_t z, SignPlane& plane) {
  const std::uint32_t margin = extraction.margin;
  const auto is_phantom = [&](std::uint32_t at, std::uint32_t samples) {
    return at < margin || at >= samples + margin;
  };
  for (std::uint32_t y = 0; y < extraction.dims.y; ++y) {
    Word* row = plane.row(y);
    std::fill_n(row, plane.words(), 0);
    if (is_phantom(y, extraction.inner.y) || is_phantom(z, extraction.inner.z)) continue;
    extraction.samples->classify(y - margin, z - margin, row);
    if (margin == 0) continue;
    Word carry = 0;  // a phantom is the first of the row
    for (std::size_t w = 0; w < plane.words(); ++w) {
      carry = std::exchange(row[w], row[w] << 1 | carry) >> (kWordBits - 1);
    }
  }
}

// The bits of the samples after those of word w.
HWY_INLINE Word next_bits(const Word* row, std::size_t w) { return row[w] >> 1 | row[w + 1] << 63; }

// True if the samples of word w of some rows, and the next one of each, are not all on one side.
template <std::size_t kRows>
HWY_INLINE bool have_both_signs(const std::array<const Word*, kRows>& rows, std::size_t w) {
  Word any = 0;
  Word all = ~Word{0};
  for (const Word* row : rows) {
    any |= row[w] | row[w + 1] << 63;
    all &= row[w] & (row[w + 1] << 63 | ~Word{0} >> 1);
  }
  return any != 0 && all != ~Word{0};
}

inline unsigned count_in_tetrahedron(const CornerWords& corners,
                                     const std::array<std::uint8_t, 4>& tetrahedron, Word cells) {
  const Word a = corners[tetrahedron[0]];
  const Word b = corners[tetrahedron[1]];
  const Word c = corners[tetrahedron[2]];
  const Word d = corners[tetrahedron[3]];
  const Word odd = (a ^ b ^ c ^ d) & cells;                         // one or three inside
  const Word mixed = ((a | b | c | d) & ~(a & b & c & d)) & cells;  // one, two or three
  return static_cast<unsigned>(std::popcount(odd) + 2 * std::popcount(mixed & ~odd));
}

// The crossed cells of a word and their cases, kept from numbering a row for writing triangles.
struct SignCells {
  Word crossed = 0;
  std::array<std::uint8_t, kWordBits> cases;
};

// One row of cells: the four rows of signs around it.
class SignRow : public RowShape {
 public:
  SignRow(const RowShape& shape, const std::array<CellSplit, 2>& splits, const SignPlane& low,
          const SignPlane& high, std::uint32_t y)
      : RowShape(shape),
        splits_(splits),
        rows_{low.row(y), low.row(next_row(y)), high.row(y), high.row(next_row(y))} {}

  // Quick test on the signs alone: false when no sample of word w has a crossed edge.
  bool may_cross(std::size_t w) const { return have_both_signs(rows_, w); }

  // The samples of word w that own a crossed edge; what is known of its cells goes to `cells`.
  Word describe(std::size_t w, SignCells& cells) const {
    const CornerWords signs = corners(w);
    const std::array<Word, 8> crossed = crossed_edges(w, signs);
    cells.crossed = crossed_cells(w, signs);
    cells.cases = transpose(signs);
    Word owners = 0;
    for (const Word edges : crossed) owners |= edges;
    return owners;
  }

  // Lists the places of the vertices that the sample at x owns, which is `bit` of the word that
  // `cells` are of. At least eight places of the list are written, and only those before what is
  // returned are valid.
  HWY_INLINE std::uint32_t* list(std::size_t x, unsigned bit, const SignCells& cells,
                                 std::uint32_t* next) const {
    return list_edges(x, directions(x, bit, cells), next);
  }

  WordCount count(std::size_t w) const {
    const CornerWords signs = corners(w);
    return {count_bits(crossed_edges(w, signs)), count_triangles(w, signs)};
  }

  CornerWords corners(std::size_t w) const {
    CornerWords corners;
    for (unsigned r = 0; r < 4; ++r) {
      corners[std::size_t{2} * r] = rows_[r][w];
      corners[std::size_t{2} * r + 1] = next_bits(rows_[r], w);
    }
    return corners;
  }

  // Word d: the samples whose edge of direction d is crossed.
  std::array<Word, 8> crossed_edges(std::size_t w, const CornerWords& corners) const {
    return edges_where(w, [&](unsigned a, unsigned b) { return corners[a] ^ corners[b]; });
  }

  unsigned count_triangles(std::size_t w, const CornerWords& corners) const {
    const Word cells = crossed_cells(w, corners);
    if (cells == 0) return 0;
    unsigned count = 0;
    for (std::size_t t = 0; t < splits_[0].tetrahedra; ++t) {
      count +=
          count_in_tetrahedron(corners, splits_[0].corners[t], is_five() ? cells & even() : cells);
      if (is_five()) {
        count += count_in_tetrahedron(corners, splits_[1].corners[t], cells & ~even());
      }
    }
    return count;
  }

  using RowShape::between_ends;

 protected:
  // The set of crossed edges that the sample owns.
  unsigned directions(std::size_t x, unsigned bit, const SignCells& cells) const {
    return splits_[parity_at(x)].crossed[cells.cases[bit]] & existing_at(x);
  }

  HWY_INLINE static std::uint32_t* list_edges(std::size_t x, unsigned directions,
                                              std::uint32_t* next) {
    return list_members(static_cast<std::uint32_t>(x * kEdgePlaces), directions, next);
  }

  // The cells that exist and have corners on both sides.
  Word crossed_cells(std::size_t w, const CornerWords& corners) const {
    Word any = 0;
    Word all = ~Word{0};
    for (const Word corner : corners) {
      any |= corner;
      all &= corner;
    }
    return any & ~all & cells(w);
  }

 private:
  const std::array<CellSplit, 2>& splits_;
  std::array<const Word*, 4> rows_;  // at (y, z), (y + 1, z), (y, z + 1), (y + 1, z + 1)
};

// Writes the triangles of the cells of one row.
class SignCellWriter {
 public:
  SignCellWriter(const std::array<CellSplit, 2>& splits, const SignRow& row,
                 const EdgeOffsets& offsets)
      : splits_(splits), row_(row), offsets_(offsets) {}

  // Writes the triangles of the cell at x, which is bit `bit` of the word that `cells` describes.
  // Returns the end of the triangles.
  HWY_INLINE Triangle* write(std::size_t x, unsigned bit, const SignCells& cells,
                             const std::uint32_t* places, Triangle* out) const {
    return write_case(splits_[row_.parity_at(x)].cases[cells.cases[bit]], places, offsets_, out);
  }

 private:
  const std::array<CellSplit, 2>& splits_;
  const SignRow row_;
  const EdgeOffsets& offsets_;
};

// An edge of a cluster: its ends, and its place, as seen from the sample that joins it.
template <class Ends>
struct ClusterEdge {
  Ends ends;
  EdgeFrame frame;
};

// The signs that the walk reads: those of the planes around the current one. Each plane is
// classified once, as z rises.
class SignField {
 public:
  using Marched = Extraction;
  using Output = Mesh;
  using Cells = SignCells;
  using Row = SignRow;
  static constexpr std::size_t kPlaces = kEdgePlaces;
  static constexpr bool kHasLines = false;
  static constexpr bool kHasClusters = false;
  // For regular-inl.h: the kinds of points that have clusters, the places of edges that clusters
  // may have, and the places for the directions of a point.
  static constexpr std::size_t kKinds = 1;
  static constexpr std::size_t kJoinedPlaces = kEdgePlaces;
  static constexpr std::uint32_t kClusterPlaces = 32;
  using Ends = EdgeSamples;

  SignField(const Extraction& extraction, std::uint32_t first)
      : extraction_(extraction),
        dims_(extraction.dims),
        planes_{SignPlane(dims_), SignPlane(dims_), SignPlane(dims_)},
        next_(first) {
    for (unsigned parity = 0; parity < 2; ++parity) {
      for (unsigned direction = 0; direction < kPlaces; ++direction) {
        const EdgeEnds edge = extraction.splits[parity].ends[direction];
        ends_[parity * kPlaces + direction] = {sample_offset(extraction.inner, edge.from),
                                               sample_offset(extraction.inner, edge.to)};
      }
    }
  }

  // Classifies up to the plane above z. Afterwards rows of z - 1 and z can be asked for.
  void reach(std::uint32_t z) {
    for (; next_ <= z + 1 && next_ < dims_.z; ++next_) {
      classify(extraction_, next_, planes_[next_ % kPlanes]);
    }
  }

  SignRow row(std::uint32_t y, std::uint32_t z) const {
    const std::uint32_t above = std::min(z + 1, dims_.z - 1);
    const Word even = extraction_.parity(0, y, z) == 0 ? kEvenX : ~kEvenX;
    return {RowShape(dims_, extraction_.scheme, even, y, z), extraction_.splits,
            planes_[z % kPlanes], planes_[above % kPlanes], y};
  }

  // The signs of a row of plane z - 1, z or z + 1.
  const Word* signs(std::uint32_t y, std::uint32_t z) const { return planes_[z % kPlanes].row(y); }

  static Mesh& mesh_of(Mesh& mesh) { return mesh; }

  EdgeFrame frame(unsigned parity, std::size_t direction) const {
    const EdgeEnds ends = extraction_.splits[parity].ends[direction];
    const Double4 start = space_offset(extraction_.to_space, ends.from);
    return {start, space_offset(extraction_.to_space, ends.to) - start};
  }

  // The share of the way along its edge of each vertex of a row between the lattice's own samples.
  auto shares(std::uint32_t y, std::uint32_t z, std::span<const std::uint32_t> vertices) {
    const std::uint32_t margin = extraction_.margin;
    if (shares_.size() < vertices.size()) shares_.resize(2 * vertices.size());
    extraction_.samples->shares({y - margin, z - margin, margin, kPlaces,
                                 extraction_.parity(0, y, z), ends_.data(), vertices},
                                shares_.data());
    return [shares = shares_.data()](std::size_t i) { return shares[i]; };
  }

  static LinksOfKinds<1> links(const Extraction& extraction) {
    return {&links_of(extraction.scheme)};
  }

  // Placed by the edge's owner, so that positions are identical to the bit.
  ClusterEdge<Ends> cluster_edge(unsigned parity, const LinkDirection& direction) const {
    const unsigned owner = parity ^ (std::popcount(direction.corner) & 1U);
    const EdgeEnds ends = extraction_.splits[owner].ends[direction.place];
    const std::ptrdiff_t to_owner = -sample_offset(extraction_.inner, direction.corner);
    ClusterEdge<Ends> edge = {{to_owner + sample_offset(extraction_.inner, ends.from),
                               to_owner + sample_offset(extraction_.inner, ends.to)},
                              frame(owner, direction.place)};
    edge.frame.start -= space_offset(extraction_.to_space, direction.corner);
    return edge;
  }

  // The shares of edges of clusters, each kClusterPlaces * x + direction. `ends`: of each
  // direction, those of even samples first.
  void cluster_shares(std::uint32_t y, std::uint32_t z, const Ends* ends,
                      std::span<const std::uint32_t> edges, double* out) const {
    const std::uint32_t margin = extraction_.margin;
    extraction_.samples->shares(
        {y - margin, z - margin, margin, kClusterPlaces, extraction_.parity(0, y, z), ends, edges},
        out);
  }

  BorderVertex place_at_border(std::uint32_t x, std::uint32_t y, std::uint32_t z,
                               std::size_t direction, const EdgeFrame& /*frame*/) const {
    const CellSplit& split = extraction_.splits[extraction_.parity(x, y, z)];
    return extraction_.samples->place_at_border(
        {std::int64_t{x} - 1, std::int64_t{y} - 1, std::int64_t{z} - 1}, split.ends[direction]);
  }

  SignCellWriter cell_writer(std::uint32_t y, std::uint32_t z, const EdgeOffsets& offsets,
                             Mesh& /*output*/) const {
    return {extraction_.splits, row(y, z), offsets};
  }

 private:
  static constexpr std::uint32_t kPlanes = 3;

  const Extraction& extraction_;
  const Dims dims_;
  std::array<SignPlane, kPlanes> planes_;
  std::uint32_t next_;
  std::array<EdgeSamples, 2 * kPlaces> ends_;  // of the edges, by parity and direction
  std::vector<double> shares_;
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
