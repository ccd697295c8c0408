// A spatial index of a surface's triangles: the nearest one to a point, those near a box.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "server/mesh/context.h"
#include "server/mesh/measure/point_triangle.h"
#include "server/mesh/measure/surface_view.h"

namespace isomesh::mesh {

// Cubic cells of about an edge's length, each with the triangles that may reach into it. Words of 4
// x 4 x 4 bits tell which cells have any, and further levels tell which words have any, so empty
// space costs almost nothing. Takes some 40 bytes a triangle, twice as many while it is built. The
// view's arrays must outlive it. Immutable, so safe to read from several threads.
class TriangleGrid {
 public:
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

  struct Nearest {
    std::uint32_t triangle = kNone;
    double squared_mm = std::numeric_limits<double>::infinity();
  };

  // Does not depend on the number of threads. Throws Error kUnusableVolume if a triangle names a
  // position that is not finite, kTooLarge if 32 bits cannot number the triangles, and kCancelled.
  TriangleGrid(const SurfaceView& surface, const Context& context);

  // The triangle nearest to the finite point; one of them if several are. Returns kNone and
  // infinity if there are no triangles. A near `guess` makes it faster; kNone is no guess.
  Nearest nearest(const Point& point, std::uint32_t guess) const;

  // Returns the first triangle found within the finite distance; much faster if it is the guess.
  // Returns kNone and infinity if there is none.
  Nearest within(const Point& point, double squared_mm, std::uint32_t guess) const;

  // Calls visit(triangle) for all triangles that reach into the box; for some several times, and
  // for some others near it.
  template <class Visit>
  void visit_near(const Point& low, const Point& high, Visit visit) const {
    if (levels_.empty()) return;
    const StepRange box = {steps_of(low), steps_of(high)};
    const CellRange range = {cell_of(box.low), cell_of(box.high)};
    auto visit_cell = [&](const Cell& cell, std::span<const Entry> entries) {
      const std::uint32_t reached = reach_in(box, cell);
      for (const Entry& entry : entries) {
        if (may_meet(reached, entry.box)) visit(entry.triangle);
      }
    };
    descend(levels_.size() - 1, {0, 0, 0}, range, visit_cell);
  }

  // Calls visit_cell(triangles) and visit_pair(i, k), with i < k, for the pairs among these that
  // may meet in a cell: for all cells with more than one triangle of one of the parts. Triangles
  // with a common point meet in some cell.
  std::size_t parts() const { return slabs_.size(); }
  template <class VisitCell, class VisitPair>
  void visit_pairs(std::size_t part, VisitCell visit_cell, VisitPair visit_pair) const {
    const Slab& slab = slabs_[part];
    for (std::size_t cell = 0; cell + 1 < slab.begins.size(); ++cell) {
      const std::span<const Entry> entries(slab.entries.data() + slab.begins[cell],
                                           slab.entries.data() + slab.begins[cell + 1]);
      if (entries.size() < 2) continue;
      visit_cell(entries);
      for (std::size_t i = 0; i + 1 < entries.size(); ++i) {
        const std::uint32_t reached = reach_of(entries[i].box);
        for (std::size_t k = i + 1; k < entries.size(); ++k) {
          if (may_meet(reached, entries[k].box)) visit_pair(i, k);
        }
      }
    }
  }

  const SurfaceView& surface() const { return surface_; }

  // A triangle in a cell.
  struct Entry {
    std::uint32_t triangle;
    std::uint32_t box;
  };

 private:
  using Cell = std::array<std::uint32_t, 3>;
  struct CellRange {
    Cell low;
    Cell high;  // the last one
  };
  // Words, x fastest. A bit stands for a cell in the lowest level, and for a word of the level
  // below in the others.
  struct Level {
    Cell words = {1, 1, 1};
    std::vector<std::uint64_t> bits;

    std::size_t index(const Cell& word) const {
      return (std::size_t{word[2]} * words[1] + word[1]) * words[0] + word[0];
    }
  };
  // In sixteenths of a cell, for comparing boxes.
  using Steps = std::array<std::uint32_t, 3>;
  struct StepRange {
    Steps low;
    Steps high;  // the last one
  };
  static constexpr std::uint32_t kCellSteps = 16;
  // A box within a cell has six fields of four bits and a spare bit: for each axis where it begins,
  // and how far before the cell's end it ends.
  static constexpr std::uint32_t kFieldBits = 5;
  static constexpr std::uint32_t kSpareBits = 0b10000'10000'10000'10000'10000'10000;
  // Some layers of words; the entries of their cells follow each other.
  struct Slab {
    std::vector<std::uint32_t> begins;  // cells + 1
    std::vector<Entry> entries;
  };
  struct Placed {
    std::uint32_t bit;  // of the slab's
    Entry entry;
  };

  static Cell cell_of(const Steps& steps) {
    return {steps[0] / kCellSteps, steps[1] / kCellSteps, steps[2] / kCellSteps};
  }
  static std::uint32_t step_in(std::uint32_t step, std::uint32_t cell) {
    const auto from_begin = static_cast<std::int32_t>(step - kCellSteps * cell);
    return static_cast<std::uint32_t>(std::clamp<std::int32_t>(from_begin, 0, kCellSteps - 1));
  }
  static std::uint32_t box_in(const StepRange& box, const Cell& cell);
  // The operands for comparing boxes: where the box ends, and where it begins.
  static std::uint32_t reach_in(const StepRange& box, const Cell& cell) {
    return box_in({box.high, box.low}, cell);
  }
  // The same of a box within the cell.
  static std::uint32_t reach_of(std::uint32_t box) {
    constexpr std::uint32_t kHalf = 3 * kFieldBits;
    constexpr std::uint32_t kFields = kSpareBits - (kSpareBits >> (kFieldBits - 1));
    const std::uint32_t opposite = ~box & kFields;
    return opposite >> kHalf | (opposite << kHalf & kFields);
  }
  static bool may_meet(std::uint32_t reach, std::uint32_t box) {
    return (((reach | kSpareBits) - box) & kSpareBits) == kSpareBits;
  }

  void choose_cells(const Context& context);
  void fill_slabs(const Context& context);
  std::vector<Placed> entries_of(
      std::uint32_t slab, std::span<const std::array<std::uint16_t, 2>> layers_of_triangles) const;
  void fill_slab(std::uint32_t slab, std::span<const Placed> entries);
  void make_upper_levels();
  template <class Put>
  void rasterise(std::uint32_t triangle, std::uint32_t first_layer, std::uint32_t last_layer,
                 Put put) const;
  Steps steps_of(const Point& point) const;
  StepRange box_of(const Corners& corners) const;
  static std::uint64_t bits_within(const CellRange& range, const Cell& word, std::size_t level);
  static unsigned bit_nearest_to_middle(const CellRange& range, const Cell& word,
                                        std::size_t level);
  // Bit n of the result is bit n ^ number of the word.
  static std::uint64_t bits_xored(std::uint64_t word, unsigned number);
  std::span<const Entry> entries_at(const Cell& word, std::size_t index, unsigned bit) const;
  double squared_distance_to(const Cell& cell, const Point& point) const;
  // A search for one point; remembers triangles that it has looked at, because cells share them.
  struct Search {
    Point point;
    double enough_squared_mm;  // no need to find a nearer one
    Nearest nearest;
    std::array<std::uint32_t, 64> seen;
  };
  void look_at(std::uint32_t triangle, Search& search) const;
  // Looks at all cells within the radius that may have something nearer than what is known.
  void look_within(double radius_mm, Search& search) const;

  // Visits the cells near the middle of the range first, roughly. `range` may shrink meanwhile.
  template <class Visit>
  void descend(std::size_t level, const Cell& word, const CellRange& range, Visit& visit) const {
    const std::size_t index = levels_[level].index(word);
    const std::uint64_t within = levels_[level].bits[index] & bits_within(range, word, level);
    if (within == 0) return;
    const unsigned middle = bit_nearest_to_middle(range, word, level);
    for (std::uint64_t rest = bits_xored(within, middle); rest != 0; rest &= rest - 1) {
      const unsigned bit = static_cast<unsigned>(std::countr_zero(rest)) ^ middle;
      const Cell below = {4 * word[0] + bit % 4, 4 * word[1] + bit / 4 % 4, 4 * word[2] + bit / 16};
      if (level == 0) {
        visit(below, entries_at(word, index, bit));
      } else {
        descend(level - 1, below, range, visit);
      }
    }
  }

  const SurfaceView surface_;
  Point low_ = {0, 0, 0};
  Point high_ = {0, 0, 0};
  double side_mm_ = 1;  // of a cell
  double steps_per_mm_ = 1;
  Steps last_step_ = {0, 0, 0};
  Cell cells_ = {1, 1, 1};
  std::uint32_t slab_layers_ = 1;      // layers of words of a slab
  std::vector<Level> levels_;          // the lowest first; none without triangles
  std::vector<std::uint32_t> before_;  // cells of its slab before each word
  std::vector<Slab> slabs_;
};

}  // namespace isomesh::mesh
