// The logic on 64 samples at a time that separating labels counts and walks with. Compiled once for
// each instruction set, see slabs.cpp.
#if defined(ISOMESH_LABELS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_LABELS_INL_H_
#undef ISOMESH_LABELS_INL_H_
#else
#define ISOMESH_LABELS_INL_H_
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include <hwy/highway.h>

#include "server/mesh/labels/label_slabs.h"
#include "server/mesh/lattice/rows-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

// The label numbers of one plane of samples. Each row goes on with its last one, so that the word
// after a row's last sample can be read.
class LabelPlane {
 public:
  static constexpr std::int32_t kMixed = -1;

  explicit LabelPlane(const Dims& dims)
      : dims_(dims),
        words_(words_of(dims.x)),
        stride_(words_ * kWordBits + 1),
        numbers_(stride_ * dims.y),
        wholes_(words_ * dims.y) {}

  const PartNumber* row(std::size_t y) const { return numbers_.data() + y * stride_; }
  // For each word, the label that its samples and the one behind them have, or kMixed.
  const std::int32_t* wholes(std::size_t y) const { return wholes_.data() + y * words_; }

  // Looks up the labels of plane z, phantoms included.
  void look_up(const Separation& separation, std::uint32_t z) {
    const Dims& inner = separation.samples->dims();
    const std::uint32_t margin = separation.margin;
    const auto is_within = [&](std::uint32_t at, std::uint32_t samples) {
      return at >= margin && at - margin < samples;
    };
    for (std::uint32_t y = 0; y < dims_.y; ++y) {
      PartNumber* const row = numbers_.data() + y * stride_;
      std::fill_n(row, dims_.x, PartNumber{0});
      if (is_within(y, inner.y) && is_within(z, inner.z)) {
        separation.samples->copy_row(y - margin, z - margin, row + margin);
      }
      std::fill(row + dims_.x, row + stride_, row[dims_.x - 1]);
      for (std::size_t w = 0; w < words_; ++w) {
        const PartNumber* word = row + w * kWordBits;
        PartNumber change = 0;
        for (std::size_t x = 0; x < kWordBits; ++x) {
          change = static_cast<PartNumber>(change | (word[x] ^ word[x + 1]));
        }
        wholes_[y * words_ + w] = change == 0 ? std::int32_t{word[0]} : kMixed;
      }
    }
  }

 private:
  Dims dims_;
  std::size_t words_;
  std::size_t stride_;
  std::vector<PartNumber> numbers_;
  std::vector<std::int32_t> wholes_;
};

// The cells of a word that have several labels.
struct LabelCells {
  Word crossed = 0;
  Word several = 0;  // more than two; of samples that own an edge of such a cell, too
  // For cells with two labels: the corners with the larger label. The surface is that of an
  // iso-value with these corners inside.
  std::array<std::uint8_t, kWordBits> cases;
};

// True if all corners of a slot have different labels.
HWY_INLINE bool is_crossed(const Slot& slot, const std::array<PartNumber, 8>& labels) {
  const auto [a, b, c, d] = slot.corners;
  if (labels[a] == labels[b]) return false;
  if (slot.size == 2) return true;
  if (labels[a] == labels[c] || labels[b] == labels[c]) return false;
  if (slot.size == 3) return true;
  return labels[a] != labels[d] && labels[b] != labels[d] && labels[c] != labels[d];
}

HWY_INLINE unsigned pattern_in(const std::array<PartNumber, 8>& labels,
                               const std::array<std::uint8_t, 4>& corners) {
  return pattern_of(
      std::array{labels[corners[0]], labels[corners[1]], labels[corners[2]], labels[corners[3]]});
}

// One row of cells: the four rows of labels around it.
class LabelRow : public RowShape {
 public:
  LabelRow(const RowShape& shape, const std::array<CellSplit, 2>& splits,
           const std::array<WallCases, 2>& walls, const LabelPlane& low, const LabelPlane& high,
           std::uint32_t y, const std::uint32_t* left_out)
      : RowShape(shape),
        splits_(splits),
        walls_(walls),
        left_out_(left_out),
        rows_{low.row(y), low.row(next_row(y)), high.row(y), high.row(next_row(y))},
        wholes_{low.wholes(y), low.wholes(next_row(y)), high.wholes(y), high.wholes(next_row(y))} {}

  // Quick test: false when no sample of word w has a crossed edge.
  bool may_cross(std::size_t w) const {
    const std::int32_t whole = wholes_[0][w];
    return whole == LabelPlane::kMixed || wholes_[1][w] != whole || wholes_[2][w] != whole ||
           wholes_[3][w] != whole;
  }

  // The samples of word w that own a crossed edge; what is known of its cells goes to `cells`.
  // A sample that owns a face or a tetrahedron with a vertex owns a crossed edge, too.
  Word describe(std::size_t w, LabelCells& cells) const {
    const CornerWords others = differing_corners(w);
    describe(w, others, cells);
    Word owners = 0;
    for (const Word edges : crossed_edges(w, others)) owners |= edges;
    return owners;
  }

  // Lists the places of the vertices that the sample at x owns, which is `bit` of the word that
  // `cells` are of, without those that are left out. At least eight places of the list are written,
  // and only those before what is returned are valid.
  HWY_INLINE std::uint32_t* list(std::size_t x, unsigned bit, const LabelCells& cells,
                                 std::uint32_t* next) const {
    const auto first = static_cast<std::uint32_t>(x * kSlotPlaces);
    if ((cells.several >> bit & 1) == 0) {
      const unsigned directions =
          splits_[parity_at(x)].crossed[cells.cases[bit]] & existing_at(x) & ~left_out_[x];
      return list_members(first, directions, next);
    }
    for (std::uint32_t slots = slots_at(x) & ~left_out_[x]; slots != 0; slots &= slots - 1) {
      *next++ = first + static_cast<std::uint32_t>(std::countr_zero(slots));
    }
    return next;
  }

  // The samples whose edge of a direction has the larger label at its first end.
  Word first_is_larger(std::size_t w, unsigned direction) const {
    return between_ends(direction, [&](unsigned a, unsigned b) {
      return compared(w, a, b, std::greater<PartNumber>());
    });
  }

  WordCount count(std::size_t w) const {
    std::array<Word, 8> crossed;
    return count(w, crossed);
  }

  // Sets crossed[d] to the samples whose edge of direction d is crossed.
  WordCount count(std::size_t w, std::array<Word, 8>& crossed) const {
    const CornerWords others = differing_corners(w);
    crossed = crossed_edges(w, others);
    WordCount count = {.vertices = count_bits(crossed)};
    LabelCells cells;
    describe(w, others, cells);
    for (Word rest = cells.crossed & ~cells.several; rest != 0; rest &= rest - 1) {
      const auto bit = static_cast<unsigned>(std::countr_zero(rest));
      count.triangles += splits_[parity_at(w * kWordBits + bit)].cases[cells.cases[bit]].triangles;
    }
    for (Word rest = cells.crossed & cells.several; rest != 0; rest &= rest - 1) {
      const std::size_t x = w * kWordBits + static_cast<unsigned>(std::countr_zero(rest));
      const std::array<PartNumber, 8> labels = labels_at(x);
      const unsigned parity = parity_at(x);
      for (std::size_t t = 0; t < splits_[parity].tetrahedra; ++t) {
        const unsigned pattern = pattern_in(labels, splits_[parity].corners[t]);
        count.triangles += walls_[parity].tetrahedra[t][pattern].triangles;
      }
    }
    for (Word rest = cells.several; rest != 0; rest &= rest - 1) {
      const auto bit = static_cast<unsigned>(std::countr_zero(rest));
      const std::uint32_t slots = slots_at(w * kWordBits + bit);
      count.vertices += static_cast<unsigned>(std::popcount(slots >> kFaceSlot));
    }
    return count;
  }

  PartNumber label(unsigned corner, std::size_t x) const {
    return rows_[corner >> 1][x + (corner & 1)];
  }

  std::array<PartNumber, 8> labels_at(std::size_t x) const {
    std::array<PartNumber, 8> labels;
    for (unsigned corner = 0; corner < 8; ++corner) labels[corner] = label(corner, x);
    return labels;
  }

 private:
  // The cells of which `compare` holds for the labels of corners a and b.
  template <class Compare>
  HWY_INLINE Word compared(std::size_t w, unsigned a, unsigned b, Compare compare) const {
    const PartNumber* const first = rows_[a >> 1] + w * kWordBits + (a & 1);
    const PartNumber* const second = rows_[b >> 1] + w * kWordBits + (b & 1);
    std::array<std::uint8_t, kWordBits> flags;
    for (std::size_t x = 0; x < kWordBits; ++x) flags[x] = compare(first[x], second[x]) ? 1 : 0;
    return pack_word(flags);
  }
  Word differ(std::size_t w, unsigned a, unsigned b) const {
    return compared(w, a, b, std::not_equal_to<PartNumber>());
  }

  // Word c: the cells whose corner c has another label than corner 0.
  CornerWords differing_corners(std::size_t w) const {
    CornerWords others = {};
    for (unsigned corner = 1; corner < 8; ++corner) others[corner] = differ(w, 0, corner);
    return others;
  }

  std::array<Word, 8> crossed_edges(std::size_t w, const CornerWords& others) const {
    return edges_where(
        w, [&](unsigned a, unsigned b) { return a == 0 ? others[b] : differ(w, a, b); });
  }

  void describe(std::size_t w, const CornerWords& others, LabelCells& cells) const {
    Word any = 0;
    for (const Word other : others) any |= other;
    cells.crossed = any & RowShape::cells(w);
    cells.several = 0;
    cells.cases = transpose(others);
    for (Word rest = any & samples(w, has_next(w)); rest != 0; rest &= rest - 1) {
      const auto bit = static_cast<unsigned>(std::countr_zero(rest));
      const std::size_t x = w * kWordBits + bit;
      const unsigned others_here = cells.cases[bit];
      const PartNumber other = label(static_cast<unsigned>(std::countr_zero(others_here)), x);
      bool is_several = false;
      for (unsigned more = others_here & (others_here - 1); more != 0; more &= more - 1) {
        is_several |= label(static_cast<unsigned>(std::countr_zero(more)), x) != other;
      }
      cells.several |= Word{is_several} << bit;
      if (label(0, x) > other) cells.cases[bit] = static_cast<std::uint8_t>(~others_here);
    }
  }

  // The set (bit s: slot s) of the vertices that the sample at x owns.
  std::uint32_t slots_at(std::size_t x) const {
    const std::array<PartNumber, 8> labels = labels_at(x);
    const WallCases& walls = walls_[parity_at(x)];
    std::uint32_t slots = 0;
    for (std::uint32_t rest = walls.existing[axes_at(x)]; rest != 0; rest &= rest - 1) {
      const auto slot = static_cast<unsigned>(std::countr_zero(rest));
      if (is_crossed(walls.slots[slot], labels)) slots |= std::uint32_t{1} << slot;
    }
    return slots;
  }

  const std::array<CellSplit, 2>& splits_;
  const std::array<WallCases, 2>& walls_;
  const std::uint32_t* left_out_;  // for each sample a set of its slots
  // At (y, z), (y + 1, z), (y, z + 1), (y + 1, z + 1).
  std::array<const PartNumber*, 4> rows_;
  std::array<const std::int32_t*, 4> wholes_;
};

// The labels that the walks read: those of the planes around the current one. Each plane is looked
// up once, as z rises.
class LabelField {
 public:
  using Marched = Separation;
  using Cells = LabelCells;

  LabelField(const Separation& separation, std::uint32_t first)
      : separation_(separation),
        dims_(separation.dims),
        planes_{LabelPlane(dims_), LabelPlane(dims_), LabelPlane(dims_)},
        next_(first) {}

  // Looks up the labels up to the plane above z. Afterwards rows of z - 1 and z can be asked for.
  void reach(std::uint32_t z) {
    for (; next_ <= z + 1 && next_ < dims_.z; ++next_) {
      planes_[next_ % kPlanes].look_up(separation_, next_);
    }
  }

  // `left_out`: what LabelRow::list leaves out, for each sample the set of the slots.
  LabelRow row(std::uint32_t y, std::uint32_t z, const std::uint32_t* left_out = nullptr) const {
    const std::uint32_t above = std::min(z + 1, dims_.z - 1);
    const Word even = separation_.parity(0, y, z) == 0 ? kEvenX : ~kEvenX;
    return {RowShape(dims_, separation_.scheme, even, y, z),
            separation_.splits,
            separation_.walls,
            planes_[z % kPlanes],
            planes_[above % kPlanes],
            y,
            left_out};
  }

  // The numbers of the labels of a row of plane z - 1, z or z + 1.
  const PartNumber* labels(std::uint32_t y, std::uint32_t z) const {
    return planes_[z % kPlanes].row(y);
  }

 private:
  static constexpr std::uint32_t kPlanes = 3;

  const Separation& separation_;
  const Dims dims_;
  std::array<LabelPlane, kPlanes> planes_;
  std::uint32_t next_;
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
