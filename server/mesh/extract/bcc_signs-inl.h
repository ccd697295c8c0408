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
        const bool inner = side == BccSide::kInner;
        for (std::size_t t = 0; t < (inner ? 4 : 2); ++t) {
          const auto& tetrahedron = (inner ? kBccInnerTetrahedra : kBccBorderTetrahedra)[t];
          count += count_in_tetrahedron(words.points, tetrahedron, words.faces);
        }
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

// The signs of the planes around the one that is worked on, each found once as z rises.
class BccField {
 public:
  using Marched = Extraction;

  BccField(const Extraction& extraction, std::uint32_t first)
      : extraction_(extraction),
        shape_(extraction),
        words_(words_of(extraction.dims.x)),
        uncertain_(words_),
        next_samples_(first),
        next_centres_(first) {
    for (std::size_t n = 0; n < kSamplePlanes; ++n) samples_.emplace_back(extraction.dims);
    for (std::size_t n = 0; n < kCentrePlanes; ++n) centres_.emplace_back(extraction.dims);
  }

  const BccShape& shape() const { return shape_; }

  // Finds what rows of plane z need. Afterwards rows of z - 1 and z can be asked for.
  void reach(std::uint32_t z) {
    const std::uint32_t end = extraction_.dims.z;
    for (; next_samples_ <= z + 2 && next_samples_ < end; ++next_samples_) {
      classify(extraction_, next_samples_, samples_[next_samples_ % kSamplePlanes]);
    }
    for (; next_centres_ <= z + 1 && next_centres_ + 1 < end; ++next_centres_) {
      if (shape_.has_plane(next_centres_)) find_centres(next_centres_);
    }
  }

  BccRow row(std::uint32_t y, std::uint32_t z) const {
    const std::uint32_t above = std::min(z + 1, extraction_.dims.z - 1);
    const SignPlane& here = centres_[z % kCentrePlanes];
    const SignPlane& next = centres_[(z + 1) % kCentrePlanes];
    const std::uint32_t behind = std::min(y + 1, extraction_.dims.y - 1);
    return {extraction_,
            shape_,
            samples_[z % kSamplePlanes],
            samples_[above % kSamplePlanes],
            {here.row(y), here.row(behind), next.row(y)},
            y,
            z};
  }

 private:
  static constexpr std::uint32_t kSamplePlanes = 4;
  static constexpr std::uint32_t kCentrePlanes = 3;

  // Rounding is monotone, so the mean of samples on one side is on that side. Only the other means
  // are computed.
  void find_centres(std::uint32_t z) {
    const SignPlane& low = samples_[z % kSamplePlanes];
    const SignPlane& high = samples_[(z + 1) % kSamplePlanes];
    const std::uint32_t margin = extraction_.margin;
    for (std::uint32_t y = 0; y + 1 < extraction_.dims.y; ++y) {
      if (!shape_.has_row(y, z)) continue;
      const std::array rows = {low.row(y), low.row(y + 1), high.row(y), high.row(y + 1)};
      Word* out = centres_[z % kCentrePlanes].row(y);
      Word mixed = 0;
      for (std::size_t w = 0; w < words_; ++w) {
        Word any = 0;
        Word all = ~Word{0};
        for (const Word* row : rows) {
          const Word next = next_bits(row, w);
          any |= row[w] | next;
          all &= row[w] & next;
        }
        const Word cells = shape_.along_x(w).cells;
        out[w] = all & cells;
        uncertain_[w] = any & ~all & cells;
        mixed |= uncertain_[w];
      }
      if (mixed != 0)
        extraction_.samples->add_centres(y - margin, z - margin, margin, uncertain_, out);
    }
  }

  const Extraction& extraction_;
  const BccShape shape_;
  const std::size_t words_;
  std::vector<SignPlane> samples_;
  std::vector<SignPlane> centres_;
  std::vector<Word> uncertain_;
  std::uint32_t next_samples_;
  std::uint32_t next_centres_;
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
