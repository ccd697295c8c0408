// The triangles of a surface by where they are: the one nearest to a point, those near a box.
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

// Cubic cells of about an edge's length, each with the triangles that may reach into it. Which
// cells have any is told by bits, 4 x 4 x 4 of them in a word, and which words have any by words
// above them, so empty space costs next to nothing. Takes some 40 bytes a triangle, and twice that
// while it is made. The view's arrays must outlive it. Immutable, so safe to read from several
// threads.
class TriangleGrid {
 public:
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

  struct Nearest {
    std::uint32_t triangle = kNone;
    double squared_mm = std::numeric_limits<double>::infinity();
  };

  // The same for any number of threads. Throws Error kUnusableVolume where a position that a
  // triangle names is not a finite number, kTooLarge where 32 bits cannot number the triangles, and
  // kCancelled.
  TriangleGrid(const SurfaceView& surface, const Context& context);

  // The triangle nearest to the point, which is finite; of several one of them. kNone and infinity
  // where there are no triangles. A guess that is near makes it faster; kNone is no guess.
  Nearest nearest(const Point& point, std::uint32_t guess) const;

  // A triangle that is no farther than that, whichever is found first: much faster where the guess
  // is one. kNone and infinity where there is none. Of a finite point and distance.
  Nearest within(const Point& point, double squared_mm, std::uint32_t guess) const;

  // Calls visit(triangle) for all triangles that reach into the box, some of them several times,
  // and for some others near it.
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

  const SurfaceView& surface() const { return surface_; }

 private:
  using Cell = std::array<std::uint32_t, 3>;
  struct CellRange {
    Cell low;
    Cell high;  // the last one
  };
  // Words, x fastest. A bit is a cell in the lowest level, in others a word of the level below.
  struct Level {
    Cell words = {1, 1, 1};
    std::vector<std::uint64_t> bits;

    std::size_t index(const Cell& word) const {
      return (std::size_t{word[2]} * words[1] + word[1]) * words[0] + word[0];
    }
  };
  // Sixteenths of a cell, by which boxes are compared; cells are whole ones.
  using Steps = std::array<std::uint32_t, 3>;
  struct StepRange {
    Steps low;
    Steps high;  // the last one
  };
  static constexpr std::uint32_t kCellSteps = 16;
  // A box within a cell is six fields of four bits and a spare one: where it begins along each
  // axis, and how far from the cell's end it ends.
  static constexpr std::uint32_t kFieldBits = 5;
  static constexpr std::uint32_t kSpareBits = 0b10000'10000'10000'10000'10000'10000;
  struct Entry {
    std::uint32_t triangle;
    std::uint32_t box;
  };
  // Some layers of words: the entries of their cells one cell after the other.
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
  // What the fields of boxes are compared with: where the box ends, and where it begins.
  static std::uint32_t reach_in(const StepRange& box, const Cell& cell) {
    return box_in({box.high, box.low}, cell);
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
  // One point's; remembers some triangles that it has looked at, which several cells have.
  struct Search {
    Point point;
    double enough_squared_mm;  // what need not be nearer
    Nearest nearest;
    std::array<std::uint32_t, 64> seen;
  };
  void look_at(std::uint32_t triangle, Search& search) const;
  // At all that may be nearer than what is known, and within the radius.
  void look_within(double radius_mm, Search& search) const;

  // The cells near the middle of the range come first, by and large. `range` may shrink while cells
  // are visited.
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
