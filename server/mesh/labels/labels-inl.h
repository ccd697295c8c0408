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
#include <span>
#include <utility>

#include <hwy/highway.h>

#include "server/mesh/extract/links.h"
#include "server/mesh/labels/label_planes-inl.h"
#include "server/mesh/labels/label_slabs.h"
#include "server/mesh/lattice/rows-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

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
           std::uint32_t y)
      : RowShape(shape),
        splits_(splits),
        walls_(walls),
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
  // `cells` are of. At least eight places of the list are written, and only those before what is
  // returned are valid.
  HWY_INLINE std::uint32_t* list(std::size_t x, unsigned bit, const LabelCells& cells,
                                 std::uint32_t* next) const {
    return list_without(0, x, bit, cells, next);
  }

  // Word d: the samples whose edge of direction d is crossed.
  std::array<Word, 8> crossed_edges(std::size_t w) const {
    return crossed_edges(w, differing_corners(w));
  }

  // The samples whose edge of a direction has the larger label at its first end.
  Word first_is_larger(std::size_t w, unsigned direction) const {
    return between_ends(direction, [&](unsigned a, unsigned b) {
      const std::size_t x = w * kWordBits;
      return compared(rows_[a >> 1] + x + (a & 1), rows_[b >> 1] + x + (b & 1), std::greater<>());
    });
  }

  WordCount count(std::size_t w) const {
    const CornerWords others = differing_corners(w);
    WordCount count = {.vertices = count_bits(crossed_edges(w, others))};
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

 protected:
  // Like list(), but without the vertices in the slots `left_out`.
  HWY_INLINE std::uint32_t* list_without(std::uint32_t left_out, std::size_t x, unsigned bit,
                                         const LabelCells& cells, std::uint32_t* next) const {
    const auto first = static_cast<std::uint32_t>(x * kSlotPlaces);
    if ((cells.several >> bit & 1) == 0) {
      const unsigned directions =
          splits_[parity_at(x)].crossed[cells.cases[bit]] & existing_at(x) & ~left_out;
      return list_members(first, directions, next);
    }
    for (std::uint32_t slots = slots_at(x) & ~left_out; slots != 0; slots &= slots - 1) {
      *next++ = first + static_cast<std::uint32_t>(std::countr_zero(slots));
    }
    return next;
  }

 private:
  // The cells in which corners a and b have different labels.
  Word differ(std::size_t w, unsigned a, unsigned b) const {
    const std::size_t x = w * kWordBits;
    return compared(rows_[a >> 1] + x + (a & 1), rows_[b >> 1] + x + (b & 1),
                    std::not_equal_to<>());
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
  // At (y, z), (y + 1, z), (y, z + 1), (y + 1, z + 1).
  std::array<const PartNumber*, 4> rows_;
  std::array<const std::int32_t*, 4> wholes_;
};

// Writes the triangles of the cells of one row, and what is on their sides. Where there are
// clusters, it leaves triangles out of which two corners are one vertex.
template <bool kHasClusters>
class LabelCellWriter {
 public:
  LabelCellWriter(const Separation& separation, const LabelRow& row, const EdgeOffsets& offsets,
                  std::uint32_t z, SeparatingSurface& surface)
      : separation_(separation),
        row_(row),
        offsets_(offsets),
        triangles_(surface.mesh.triangles.data()),
        end_(triangles_ + surface.mesh.layer_triangles[z + 1]),
        sides_(surface.sides.data()) {}

  // Writes the triangles of the cell at x and their sides. The cell is bit `bit` of the word that
  // `cells` describes. Returns the end of the triangles.
  HWY_INLINE Triangle* write(std::size_t x, unsigned bit, const LabelCells& cells,
                             const std::uint32_t* places, Triangle* out) const {
    if ((cells.several >> bit & 1) != 0) return write_several(x, places, out);
    const unsigned inside = cells.cases[bit];
    const CellCase& cell = separation_.splits[row_.parity_at(x)].cases[inside];
    Triangle* end = nullptr;
    if constexpr (kHasClusters) {
      end = write_kept(cell, places, offsets_, end_, out);
    } else {
      end = write_case(cell, places, offsets_, out);
    }
    const WallSides sides = {row_.label(static_cast<unsigned>(std::countr_one(inside)), x),
                             row_.label(static_cast<unsigned>(std::countr_zero(inside)), x)};
    std::fill(sides_ + (out - triangles_), sides_ + (end - triangles_), sides);
    return end;
  }

 private:
  Triangle* write_several(std::size_t x, const std::uint32_t* places, Triangle* out) const {
    const std::array<PartNumber, 8> labels = row_.labels_at(x);
    const unsigned parity = row_.parity_at(x);
    const CellSplit& split = separation_.splits[parity];
    const auto index = [&](VertexName name) {
      return places[offsets_[edge_name(name / kSlotPlaces, 0)] +
                    static_cast<std::ptrdiff_t>(name % kSlotPlaces)];
    };
    for (std::size_t t = 0; t < split.tetrahedra; ++t) {
      const unsigned pattern = pattern_in(labels, split.corners[t]);
      const TetrahedronWalls& walls = separation_.walls[parity].tetrahedra[t][pattern];
      for (std::size_t i = 0; i < walls.triangles; ++i) {
        const WallTriangle& wall = walls.walls[i];
        Triangle triangle = {index(wall.vertices[0]), index(wall.vertices[1]),
                             index(wall.vertices[2])};
        WallSides sides = {labels[wall.front], labels[wall.back]};
        const auto& [a, b, c] = triangle;
        if (kHasClusters && (a == b || b == c || c == a)) continue;
        if (sides.front > sides.back) {
          std::swap(sides.front, sides.back);
          std::swap(triangle[1], triangle[2]);
        }
        sides_[out - triangles_] = sides;
        *out++ = triangle;
      }
    }
    return out;
  }

  const Separation& separation_;
  const LabelRow row_;
  const EdgeOffsets& offsets_;
  Triangle* triangles_;
  const Triangle* end_;  // of the layer's triangles
  WallSides* sides_;
};

// The labels that the walk reads: those of the planes around the current one. Each plane is looked
// up once, as z rises.
class LabelField {
 public:
  using Marched = Separation;
  using Output = SeparatingSurface;
  using Cells = LabelCells;
  using Row = LabelRow;
  static constexpr std::size_t kPlaces = kSlotPlaces;
  static constexpr bool kHasLines = true;
  static constexpr bool kHasClusters = false;

  LabelField(const Separation& separation, std::uint32_t first)
      : separation_(separation),
        dims_(separation.dims),
        planes_{LabelPlane(dims_), LabelPlane(dims_), LabelPlane(dims_)},
        next_(first) {
    const std::span<const LinkDirection> directions = links_of(separation.scheme).directions();
    for (unsigned parity = 0; parity < 2; ++parity) {
      for (std::size_t place = 0; place < kEdgePlaces; ++place) {
        const auto& ends = separation.walls[parity].slots[place].corners;
        for (std::size_t end = 0; end < 2; ++end) {
          const auto step = cell_step(ends[end], ends[1 - end]);
          const auto found = std::ranges::find(directions, step, &LinkDirection::step);
          if (found == directions.end()) continue;  // no edge in that place
          ways_[parity][place][end] = Directions{1} << (found - directions.begin());
        }
      }
    }
  }

  // Looks up the labels up to the plane above z. Afterwards rows of z - 1 and z can be asked for.
  void reach(std::uint32_t z) {
    for (; next_ <= z + 1 && next_ < dims_.z; ++next_) {
      classify(separation_, next_, planes_[next_ % kPlanes]);
    }
  }

  LabelRow row(std::uint32_t y, std::uint32_t z) const {
    const std::uint32_t above = std::min(z + 1, dims_.z - 1);
    const Word even = separation_.parity(0, y, z) == 0 ? kEvenX : ~kEvenX;
    return {RowShape(dims_, separation_.scheme, even, y, z),
            separation_.splits,
            separation_.walls,
            planes_[z % kPlanes],
            planes_[above % kPlanes],
            y};
  }

  // The numbers of the labels of a row of plane z - 1, z or z + 1.
  const PartNumber* labels(std::uint32_t y, std::uint32_t z) const {
    return planes_[z % kPlanes].row(y);
  }

  static Mesh& mesh_of(SeparatingSurface& surface) { return surface.mesh; }

  // A vertex lies half-way on its edge, or on the line from its slot's first corner to twice the
  // way to the mean of all.
  EdgeFrame frame(unsigned parity, std::size_t place) const {
    EdgeFrame frame;
    if (place >= kSlots) return frame;
    const Slot& slot = separation_.walls[parity].slots[place];
    if (slot.size == 0) return frame;
    const LatticeToSpace& map = separation_.to_space;
    frame.start = space_offset(map, slot.corners[0]);
    Double4 ways = {};
    for (std::size_t i = 1; i < slot.size; ++i) {
      ways += space_offset(map, slot.corners[i]) - frame.start;
    }
    frame.run = ways * 2 / static_cast<double>(slot.size);
    return frame;
  }

  auto shares(std::uint32_t /*y*/, std::uint32_t /*z*/,
              std::span<const std::uint32_t> /*vertices*/) const {
    return [](std::size_t /*vertex*/) { return 0.5; };
  }

  // Phantoms have one label, so no more than one corner is one. The vertex is half-way to it from
  // the mean of the others, which are next to it: so in a face of the box of voxels.
  BorderVertex place_at_border(std::uint32_t x, std::uint32_t y, std::uint32_t z, std::size_t place,
                               const EdgeFrame& frame) const {
    const Slot& slot = separation_.walls[separation_.parity(x, y, z)].slots[place];
    const LatticeToSpace& map = separation_.to_space;
    // In the lattice's own numbers, in the order of place_inner for the same bits.
    const Double4 at = row_origin(map, static_cast<double>(y) - 1, static_cast<double>(z) - 1) +
                       lanes(map.step_x) * (static_cast<double>(x) - 1);
    Double4 exact = at + frame.start + frame.run * 0.5;
    const std::array<std::uint32_t, 3> cell = {x, y, z};
    std::array<bool, 6> in_face = {true, true, true, true, true, true};
    Double4 others = {};
    Double4 phantom = {};
    bool has_phantom = false;
    for (std::size_t i = 0; i < slot.size; ++i) {
      const unsigned corner = slot.corners[i];
      const Double4 corner_at = space_offset(map, corner);
      if (is_phantom(cell, corner)) {
        has_phantom = true;
        phantom = corner_at;
      } else {
        others += corner_at;
      }
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::uint32_t to = cell[axis] + (corner >> axis & 1);
        in_face[axis] = in_face[axis] && to == 1;
        in_face[3 + axis] = in_face[3 + axis] && to + 2 == samples_along(axis);
      }
    }
    if (has_phantom) exact = at + (others / (slot.size - 1.0) + phantom) * 0.5;
    BorderVertex vertex;
    for (std::size_t i = 0; i < 3; ++i) vertex.position[i] = static_cast<float>(exact[i]);
    vertex.on_border = has_phantom || std::ranges::count(in_face, true) > 0;
    return vertex;
  }

  // Tells the owners of vertices that samples of a row name, in the places `vertices`. `first` is
  // the first one's number.
  void tell_owners(std::uint32_t y, std::uint32_t z, std::span<const std::uint32_t> vertices,
                   std::uint32_t first, SeparatingSurface& surface) const {
    const std::uint32_t behind = std::min(y + 1, dims_.y - 1);
    const std::uint32_t above = std::min(z + 1, dims_.z - 1);
    const std::array rows = {labels(y, z), labels(behind, z), labels(y, above),
                             labels(behind, above)};
    const unsigned row_parity = separation_.parity(0, y, z);
    VertexOwner* out = surface.owners.data() + first;
    for (const std::uint32_t vertex : vertices) {
      const std::uint32_t x = vertex / kPlaces;
      const std::size_t place = vertex % kPlaces;
      const unsigned parity = (x + row_parity) & 1;
      const Slot& slot = separation_.walls[parity].slots[place];
      std::size_t owner = 0;
      PartNumber most = 0;
      for (std::size_t i = 0; i < slot.size; ++i) {
        const unsigned corner = slot.corners[i];
        const PartNumber label = rows[corner >> 1][x + (corner & 1)];
        if (label <= most) continue;
        most = label;
        owner = i;
      }
      const unsigned corner = slot.corners[owner];
      *out = {};
      out->sample = sample_at(x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2));
      if (place < kEdgePlaces) out->directions = ways_[parity][place][owner];
      ++out;
    }
  }

  LabelCellWriter<false> cell_writer(std::uint32_t y, std::uint32_t z, const EdgeOffsets& offsets,
                                     SeparatingSurface& surface) const {
    return {separation_, row(y, z), offsets, z, surface};
  }

 protected:
  // In the lattice's own numbers, where phantoms are numbered too.
  std::uint64_t sample_at(std::uint32_t x, std::uint32_t y, std::uint32_t z) const {
    const Dims& inner = separation_.samples->dims();
    const std::uint32_t margin = separation_.margin;
    return (std::uint64_t{z - margin} * inner.y + (y - margin)) * inner.x + (x - margin);
  }

 private:
  static constexpr std::uint32_t kPlanes = 3;

  static std::array<int, 3> cell_step(unsigned from, unsigned to) {
    std::array<int, 3> step;
    for (unsigned axis = 0; axis < 3; ++axis) {
      step[axis] = static_cast<int>(to >> axis & 1) - static_cast<int>(from >> axis & 1);
    }
    return step;
  }

  std::uint32_t samples_along(std::size_t axis) const {
    return std::array{dims_.x, dims_.y, dims_.z}[axis];
  }

  bool is_phantom(const std::array<std::uint32_t, 3>& cell, unsigned corner) const {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::uint32_t at = cell[axis] + (corner >> axis & 1);
      if (at == 0 || at + 1 == samples_along(axis)) return true;
    }
    return false;
  }

  const Separation& separation_;
  const Dims dims_;
  std::array<LabelPlane, kPlanes> planes_;
  // By parity and place of an edge: its direction from its first end, and from its second.
  std::array<std::array<std::array<Directions, 2>, kEdgePlaces>, 2> ways_ = {};
  std::uint32_t next_;
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
