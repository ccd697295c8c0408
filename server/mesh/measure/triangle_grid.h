// A spatial index of a surface's triangles: the nearest one to a point, those along a line.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "server/mesh/context.h"
#include "server/mesh/measure/point_triangle.h"
#include "server/mesh/measure/surface_view.h"
#include "server/mesh/measure/triangle_tree.h"

namespace isomesh::mesh {

// Cubic cells of about an edge's length, each with the triangles that may reach into it. Words of 4
// x 4 x 4 bits tell which cells have any, and further levels tell which words have any, so empty
// space costs almost nothing. A cell is crowded if edges are much shorter along one axis than along
// another, or if triangles differ much in size. It has a tree then (triangle_tree.h), so a search
// looks at few triangles at any spacing. Takes some 40 bytes a triangle, twice as many while it is
// built, and up to 100 with trees. The view's arrays must outlive it. Immutable, so safe to read
// from several threads.
class TriangleGrid {
 public:
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

  struct Nearest {
    std::uint32_t triangle = kNone;
    double squared_mm = std::numeric_limits<double>::infinity();
    std::uint64_t steps = 0;  // cells, boxes and triangles that were looked at
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

  // Calls visit(triangle) for all triangles that the line between two finite points may meet; for
  // some several times, and for some others near it. `to` may come nearer meanwhile. Returns how
  // many cells it looked into.
  template <class Visit>
  std::uint64_t visit_along(const Point& from, const Point& to, Visit visit) const {
    if (levels_.empty()) return 0;
    const StepRange box = box_of({from, to, to});
    const CellRange range = {cell_of(box.low), cell_of(box.high)};
    std::uint64_t cells = 0;
    const auto visit_cell = [&](const Cell& cell, const Content& content) {
      if (!is_on(0, cell, from, to)) return;
      ++cells;
      if (content.tree != nullptr) {
        return content.tree->visit_along(content.entries, from, to,
                                         [&](const Entry& entry) { visit(entry.triangle); });
      }
      const std::uint32_t reached = reach_in(box, cell);
      for (const Entry& entry : content.entries) {
        if (BoxInCell::may_meet(reached, entry.box)) visit(entry.triangle);
      }
    };
    const auto reaches = [&](std::size_t level, const Cell& word) {
      return is_on(level, word, from, to);
    };
    descend(levels_.size() - 1, {0, 0, 0}, range, reaches, visit_cell);
    return cells;
  }

  // Calls visit_cell(triangles) and visit_pair(i, k), with i < k, for the pairs among these that
  // may meet in a cell: for all cells with more than one triangle of one of the parts. Triangles
  // with a common point meet in some cell.
  std::size_t parts() const { return slabs_.size(); }
  template <class VisitCell, class VisitPair>
  void visit_pairs(std::size_t part, VisitCell visit_cell, VisitPair visit_pair) const {
    const Slab& slab = slabs_[part];
    for (std::size_t cell = 0; cell + 1 < slab.begins.size(); ++cell) {
      const auto [entries, tree] = slab.content(cell);
      if (entries.size() < 2) continue;
      visit_cell(entries);
      if (tree != nullptr) {
        tree->visit_pairs(entries, visit_pair);
        continue;
      }
      for (std::size_t i = 0; i + 1 < entries.size(); ++i) {
        const std::uint32_t reached = BoxInCell::reach_of(entries[i].box);
        for (std::size_t k = i + 1; k < entries.size(); ++k) {
          if (BoxInCell::may_meet(reached, entries[k].box)) visit_pair(i, k);
        }
      }
    }
  }

  // Calls visit(other) for the other triangles of the surface that may have a point in common with
  // this one; for some several times.
  void visit_meeting(std::uint32_t triangle,
                     const std::function<void(std::uint32_t other)>& visit) const;

  // How much was done to build it, and how much it holds.
  struct Size {
    std::uint64_t tested_cells = 0;  // of triangles that may reach into several
    std::uint64_t entries = 0;       // triangles of cells
    std::uint64_t nodes = 0;         // of the trees of crowded cells
  };
  Size size() const;

  const SurfaceView& surface() const { return surface_; }

  using Entry = TriangleInCell;

 private:
  static constexpr std::uint32_t kWordSide = 4;  // cells of a word along each axis
  static constexpr std::uint32_t kWordCells = 64;
  // A cell with more triangles has a tree. On an even lattice hardly any cell has so many.
  static constexpr std::size_t kCrowd = 64;

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
  // In sixteenths of a cell (BoxInCell), for comparing boxes.
  using Steps = std::array<std::uint32_t, 3>;
  struct StepRange {
    Steps low;
    Steps high;  // the last one
  };
  static constexpr std::uint32_t kCellSteps = BoxInCell::kSteps;
  // The triangles of a cell.
  struct Content {
    std::span<const Entry> entries;
    const TriangleTree* tree;  // null if it is not crowded
  };
  // Some layers of words; the entries of their cells follow each other.
  struct Slab {
    std::vector<std::uint32_t> begins;  // cells + 1
    std::vector<Entry> entries;
    std::vector<std::size_t> crowded;  // cells
    std::vector<TriangleTree> trees;   // of these
    std::uint64_t tested_cells = 0;

    Content content(std::size_t cell) const {
      const auto its = std::span(entries).subspan(begins[cell], begins[cell + 1] - begins[cell]);
      if (its.size() <= kCrowd) return {its, nullptr};
      return {its, &trees[static_cast<std::size_t>(std::ranges::lower_bound(crowded, cell) -
                                                   crowded.begin())]};
    }
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
  static Steps steps_in(const Steps& steps, const Cell& cell) {
    return {step_in(steps[0], cell[0]), step_in(steps[1], cell[1]), step_in(steps[2], cell[2])};
  }
  static std::uint32_t box_in(const StepRange& box, const Cell& cell) {
    return BoxInCell::of(steps_in(box.low, cell), steps_in(box.high, cell));
  }
  static std::uint32_t reach_in(const StepRange& box, const Cell& cell) {
    return BoxInCell::reach(steps_in(box.low, cell), steps_in(box.high, cell));
  }

  void choose_cells(const Context& context);
  void fill_slabs(const Context& context);
  std::vector<Placed> entries_of(std::uint32_t slab,
                                 std::span<const std::array<std::uint16_t, 2>> layers_of_triangles);
  void fill_slab(std::uint32_t slab, std::span<const Placed> entries);
  void make_trees(const Context& context);
  void make_upper_levels();
  template <class Put>
  std::uint64_t rasterise(std::uint32_t triangle, std::uint32_t first_layer,
                          std::uint32_t last_layer, Put put) const;
  Steps steps_of(const Point& point) const;
  StepRange box_of(const Corners& corners) const;
  Point centre_of(const Cell& cell) const;
  static std::uint64_t bits_within(const CellRange& range, const Cell& word, std::size_t level);
  static unsigned bit_nearest_to_middle(const CellRange& range, const Cell& word,
                                        std::size_t level);
  // Bit n of the result is bit n ^ number of the word.
  static std::uint64_t bits_xored(std::uint64_t word, unsigned number);
  Content content_at(const Cell& word, std::size_t index, unsigned bit) const;
  // To a cell, or to a word of the level below.
  double squared_distance_to(std::size_t level, const Cell& cell, const Point& point) const;
  // True if the line between two points may meet such a cell or word.
  bool is_on(std::size_t level, const Cell& cell, const Point& from, const Point& to) const;
  // A search for one point; remembers triangles that it has looked at, because cells share them.
  struct Search {
    Point point;
    double enough_squared_mm;  // no need to find a nearer one
    bool is_in_order;          // looks at the triangles of a cell by their numbers
    Nearest nearest;
    std::array<std::uint32_t, 64> seen;
  };
  void look_at(std::uint32_t triangle, Search& search) const;
  // Looks at all cells within the radius that may have something nearer than what is known.
  void look_within(double radius_mm, Search& search) const;

  // Visits the cells near the middle of the range first, roughly, but no word for which
  // reaches(level, number) is false. `range` may shrink meanwhile.
  template <class Reaches, class Visit>
  void descend(std::size_t level, const Cell& word, const CellRange& range, Reaches& reaches,
               Visit& visit) const {
    const std::size_t index = levels_[level].index(word);
    const std::uint64_t within = levels_[level].bits[index] & bits_within(range, word, level);
    if (within == 0) return;
    const unsigned middle = bit_nearest_to_middle(range, word, level);
    for (std::uint64_t rest = bits_xored(within, middle); rest != 0; rest &= rest - 1) {
      const unsigned bit = static_cast<unsigned>(std::countr_zero(rest)) ^ middle;
      const Cell below = {4 * word[0] + bit % 4, 4 * word[1] + bit / 4 % 4, 4 * word[2] + bit / 16};
      if (level == 0) {
        visit(below, content_at(word, index, bit));
      } else if (reaches(level, below)) {
        descend(level - 1, below, range, reaches, visit);
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
