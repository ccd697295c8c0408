// The body-centred lattice (bcc_faces.h) on 64 samples at a time: which samples and centres are
// inside, which edges are crossed, which faces have triangles. Compiled once for each instruction
// set, see slabs.cpp.
#if defined(ISOMESH_BCC_SIGNS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_BCC_SIGNS_INL_H_
#undef ISOMESH_BCC_SIGNS_INL_H_
#else
#define ISOMESH_BCC_SIGNS_INL_H_
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <hwy/highway.h>

#include "server/mesh/extract/signs-inl.h"
#include "server/mesh/extract/slabs.h"
#include "server/mesh/lattice/bcc_faces.h"
#include "server/mesh/lattice/rows-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

// The samples and cells of a word that have neighbours along x, a bit for each.
struct BccAlongX {
  Word edges = 0;  // the samples that have a next one
  Word cells = 0;  // the cells that have a centre, and those whose next or last one has
  Word next = 0;
  Word last = 0;
};

// The cells that have a centre: those between the lattice's own samples.
class BccShape {
 public:
  explicit BccShape(const Extraction& extraction)
      : first_(extraction.margin),
        end_{extraction.dims.x - 1 - first_, extraction.dims.y - 1 - first_,
             extraction.dims.z - 1 - first_},
        along_x_(words_of(extraction.dims.x)) {
    for (std::int64_t x = 0; x < std::int64_t{extraction.dims.x}; ++x) {
      BccAlongX& word = along_x_[static_cast<std::size_t>(x) / kWordBits];
      const auto mark = [bit = Word{1} << x % kWordBits](Word& in, bool is_there) {
        if (is_there) in |= bit;
      };
      mark(word.edges, x + 1 < std::int64_t{extraction.dims.x});
      mark(word.cells, has_column(x));
      mark(word.next, has_column(x + 1));
      mark(word.last, has_column(x - 1));
    }
  }

  HWY_INLINE const BccAlongX& along_x(std::size_t w) const { return along_x_[w]; }

  bool has_row(std::int64_t y, std::int64_t z) const {
    return y >= first_ && y < end_[1] && has_plane(z);
  }

  bool has_cell(std::int64_t x, std::int64_t y, std::int64_t z) const {
    return has_column(x) && has_row(y, z);
  }

  bool has_plane(std::int64_t z) const { return z >= first_ && z < end_[2]; }

 private:
  bool has_column(std::int64_t x) const { return x >= first_ && x < end_[0]; }

  std::int64_t first_;
  std::array<std::int64_t, 3> end_;
  std::vector<BccAlongX> along_x_;
};

// The faces of one axis above 64 cells, or below them, that lie on one side.
struct BccFaceWords {
  std::array<Word, 8> points = {};  // those of a case that are inside
  Word faces = 0;                   // those that exist and have points on both sides
};

// The slots of 64 records whose edges have vertices of their own, kept from numbering a row for
// writing triangles.
struct BccCells {
  // Returns the records that own some of `edges`, a word for each slot.
  Word keep(const std::array<Word, kBccSlots>& edges) {
    crossed = ~Word{0};
    BitWords words;
    Word owners = 0;
    for (std::size_t half = 0; half < slots.size(); ++half) {
      std::copy_n(edges.begin() + half * 8, 8, words.begin());
      for (const Word word : words) owners |= word;
      slots[half] = transpose(words);
    }
    last = edges[16];
    return owners | last;
  }

  Word crossed = 0;  // not 0 if cells of the word may have triangles
  std::array<BitBytes, 2> slots;
  Word last = 0;  // slot 16
};

// One row of cells with the signs of its samples and of the centres that its edges lead to.
class BccRow {
 public:
  struct Centres {
    const Word* own;
    const Word* next_y;
    const Word* next_z;
  };

  // `shape` must outlive the row.
  BccRow(const Extraction& extraction, const BccShape& shape, const SignPlane& low,
         const SignPlane& high, const Centres& centres, std::uint32_t y, std::uint32_t z)
      : six_(extraction.splits[0]),
        shape_(shape),
        centres_(centres),
        has_y_(y + 1 < extraction.dims.y),
        has_z_(z + 1 < extraction.dims.z),
        has_phantoms_(extraction.margin != 0),
        has_centres_(shape_.has_row(y, z)),
        has_next_y_(shape_.has_row(std::int64_t{y} + 1, z)),
        has_next_z_(shape_.has_row(y, std::int64_t{z} + 1)),
        has_last_y_(shape_.has_row(std::int64_t{y} - 1, z)),
        has_last_z_(shape_.has_row(y, std::int64_t{z} - 1)) {
    const std::uint32_t next = has_y_ ? y + 1 : y;
    samples_ = {low.row(y), low.row(next), high.row(y), high.row(next)};
    // A row of samples stands for rows of centres that there are not.
    looked_at_ = {samples_[0],
                  samples_[1],
                  samples_[2],
                  samples_[3],
                  has_centres_ ? centres.own : samples_[0],
                  has_next_y_ ? centres.next_y : samples_[0],
                  has_next_z_ ? centres.next_z : samples_[0]};
  }

  // Quick test on the signs alone: false when nothing of word w is crossed.
  HWY_INLINE bool may_cross(std::size_t w) const { return have_both_signs(looked_at_, w); }

  // The records of word w that own a vertex.
  Word describe(std::size_t w, BccCells& cells) const {
    return cells.keep(crossed_edges(w, corners(w)));
  }

  // Lists the places of the vertices that the record at x owns, which is `bit` of the word that
  // `cells` are of. Eight places more are written, and only those before what is returned are
  // valid.
  HWY_INLINE static std::uint32_t* list(std::size_t x, unsigned bit, const BccCells& cells,
                                        std::uint32_t* next) {
    const auto first = static_cast<std::uint32_t>(x * kBccPlaces);
    next = list_members(first, cells.slots[0][bit], next);
    next = list_members(first + 8, cells.slots[1][bit], next);
    if ((cells.last >> bit & 1) != 0) *next++ = first + 16;
    return next;
  }

  HWY_INLINE CornerWords corners(std::size_t w) const {
    CornerWords corners;
    for (std::size_t r = 0; r < 4; ++r) {
      corners[2 * r] = samples_[r][w];
      corners[2 * r + 1] = next_bits(samples_[r], w);
    }
    return corners;
  }

  unsigned count_triangles(std::size_t w, const CornerWords& corners) const {
    unsigned count = 0;
    for (unsigned axis = 0; axis < 3; ++axis) {
      for (const BccSide side : kBccSides) {
        const BccFaceWords words = faces(w, axis, side, corners);
        if (words.faces == 0) continue;
        const auto count_all = [&](const auto& tetrahedra) {
          for (const Tetrahedron& tetrahedron : tetrahedra) {
            count += count_in_tetrahedron(words.points, tetrahedron, words.faces);
          }
        };
        side == BccSide::kInner ? count_all(kBccInnerTetrahedra) : count_all(kBccBorderTetrahedra);
      }
    }
    if (const Word cells = split_in_six(w); cells != 0) {
      for (std::size_t t = 0; t < six_.tetrahedra; ++t) {
        count += count_in_tetrahedron(corners, six_.corners[t], cells);
      }
    }
    return count;
  }

  WordCount count(std::size_t w) const {
    const CornerWords corners = this->corners(w);
    return {count_bits(crossed_edges(w, corners)), count_triangles(w, corners)};
  }

  // The cells whose centre is inside.
  Word centre(std::size_t w) const { return has_centres_ ? centres_.own[w] : 0; }

  // Word s: the samples whose edge of slot s exists and is crossed.
  HWY_INLINE std::array<Word, kBccSlots> crossed_edges(std::size_t w,
                                                       const CornerWords& corners) const {
    std::array<Word, kBccSlots> crossed = {};
    const BccAlongX& along_x = shape_.along_x(w);
    const Word cells = cells_of(w);
    if (has_centres_) {
      const Word centre = centres_.own[w];
      for (std::size_t c = 0; c < 8; ++c) crossed[c] = (corners[c] ^ centre) & cells;
      crossed[11] = (centre ^ next_bits(centres_.own, w)) & cells & along_x.next;
      if (has_next_y_) crossed[12] = (centre ^ centres_.next_y[w]) & cells;
      if (has_next_z_) crossed[13] = (centre ^ centres_.next_z[w]) & cells;
    }
    if (has_phantoms_) crossed[0] |= (corners[0] ^ corners[7]) & split_in_six(w);
    crossed[8] = (corners[0] ^ corners[1]) & along_x.edges;
    if (has_y_) crossed[9] = corners[0] ^ corners[2];
    if (has_z_) crossed[10] = corners[0] ^ corners[4];
    if (has_y_ && has_z_) {
      crossed[14] = (corners[0] ^ corners[6]) & ~(cells & along_x.last);
    }
    if (has_z_) {
      crossed[15] = (corners[0] ^ corners[5]) & along_x.edges & ~(has_last_y_ ? cells : 0);
    }
    if (has_y_) {
      crossed[16] = (corners[0] ^ corners[3]) & along_x.edges & ~(has_last_z_ ? cells : 0);
    }
    return crossed;
  }

  // The cells that have no centre: those with a phantom.
  Word split_in_six(std::size_t w) const {
    if (!has_phantoms_ || !has_y_ || !has_z_) return 0;
    return shape_.along_x(w).edges & ~cells_of(w);
  }

  // The faces of the cells of word w that the cells write the triangles of: each cell writes those
  // above it, and those below it at the border.
  HWY_INLINE BccFaceWords faces(std::size_t w, unsigned axis, BccSide side,
                                const CornerWords& corners) const {
    BccFaceWords result;
    const Word cells = cells_of(w);
    if (cells == 0) return result;
    const Word centre = centres_.own[w];
    result.points[0] = result.points[1] = centre;
    switch (side) {
      case BccSide::kInner:
        result.points[1] = next_centres(w, axis);
        result.faces = cells & has_next(w, axis);
        break;
      case BccSide::kLow:
        result.faces = cells & ~has_last(w, axis);
        break;
      case BccSide::kHigh:
        result.faces = cells & ~has_next(w, axis);
        break;
    }
    if (result.faces == 0) return result;
    const unsigned plane = side == BccSide::kLow ? 0 : 1U << axis;
    const auto around = bcc_corners(axis);
    for (std::size_t c = 0; c < 4; ++c) result.points[2 + c] = corners[around[c] | plane];
    Word any = 0;
    Word all = ~Word{0};
    for (std::size_t p = 0; p < 6; ++p) {
      any |= result.points[p];
      all &= result.points[p];
    }
    result.faces &= any & ~all;
    return result;
  }

 private:
  Word cells_of(std::size_t w) const { return has_centres_ ? shape_.along_x(w).cells : 0; }

  Word next_centres(std::size_t w, unsigned axis) const {
    if (axis == 0) return next_bits(centres_.own, w);
    return axis == 1 ? centres_.next_y[w] : centres_.next_z[w];
  }

  // The cells of word w whose next or last one along the axis has a centre.
  Word has_next(std::size_t w, unsigned axis) const {
    if (axis == 0) return shape_.along_x(w).next;
    return (axis == 1 ? has_next_y_ : has_next_z_) ? ~Word{0} : 0;
  }
  Word has_last(std::size_t w, unsigned axis) const {
    if (axis == 0) return shape_.along_x(w).last;
    return (axis == 1 ? has_last_y_ : has_last_z_) ? ~Word{0} : 0;
  }

  const CellSplit& six_;  // of cells without a centre
  const BccShape& shape_;
  std::array<const Word*, 4> samples_;    // as those of SignRow
  std::array<const Word*, 7> looked_at_;  // by may_cross
  Centres centres_;
  bool has_y_;
  bool has_z_;
  bool has_phantoms_;
  bool has_centres_;  // in this row
  bool has_next_y_;   // in the row behind
  bool has_next_z_;   // in the row above
  bool has_last_y_;
  bool has_last_z_;
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
