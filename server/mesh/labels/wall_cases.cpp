#include "server/mesh/labels/wall_cases.h"

#include <algorithm>
#include <bit>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "server/mesh/points.h"

namespace isomesh::mesh {
namespace {

using Corners = unsigned;  // a set: bit c is corner c
using Point = std::array<int, 3>;

Corners set_of(std::span<const std::uint8_t> corners) {
  Corners set = 0;
  for (const std::uint8_t corner : corners) set |= 1U << corner;
  return set;
}

Slot slot_of(Corners set) {
  Slot slot;
  for (Corners rest = set; rest != 0; rest &= rest - 1) {
    slot.corners[slot.size++] = static_cast<std::uint8_t>(std::countr_zero(rest));
  }
  return slot;
}

// The corner that is the smallest of the set along every axis.
unsigned owner_of(Corners set) {
  unsigned owner = 7;
  for (; set != 0; set &= set - 1) owner &= static_cast<unsigned>(std::countr_zero(set));
  return owner;
}

// And the largest.
unsigned end_of(Corners set) {
  unsigned end = 0;
  for (; set != 0; set &= set - 1) end |= static_cast<unsigned>(std::countr_zero(set));
  return end;
}

using Slots = std::array<Slot, kSlots>;

// The edges, faces and tetrahedra of a split cell that its corner 0 owns.
Slots slots_of(const CellSplit& split) {
  std::array<std::set<Corners>, 5> found;  // by their number
  for (std::size_t t = 0; t < split.tetrahedra; ++t) {
    const Corners all = set_of(split.corners[t]);
    for (Corners some = all; some != 0; some = (some - 1) & all) {
      if (owner_of(some) == 0) found[static_cast<std::size_t>(std::popcount(some))].insert(some);
    }
  }
  Slots slots = {};
  for (const Corners edge : found[2]) slots[end_of(edge)] = slot_of(edge);
  std::ranges::transform(found[3], slots.begin() + kFaceSlot, slot_of);
  std::ranges::transform(found[4], slots.begin() + kTetrahedronSlot, slot_of);
  return slots;
}

// The cases of one tetrahedron are made in its own corners.
class TetrahedronBuilder {
 public:
  // `slots`: of samples of even and odd parity.
  TetrahedronBuilder(const Tetrahedron& corners, bool odd, const std::array<Slots, 2>& slots)
      : corners_(corners), odd_(odd), slots_(slots) {}

  // `classes`: for each corner the first one with the same label.
  TetrahedronWalls build(const std::array<unsigned, 4>& classes) {
    walls_ = {};
    std::array<unsigned, 4> sizes = {};
    for (const unsigned label : classes) ++sizes[label];
    const auto labels = 4 - std::ranges::count(sizes, 0U);
    if (labels == 2) add_two(classes);
    if (labels == 3) add_three(classes, sizes);
    if (labels == 4) add_four();
    return walls_;
  }

 private:
  // A vertex on what some of the tetrahedron's corners span.
  struct Spot {
    VertexName name;
    Point at;  // times 12
  };

  template <class... Corner>
  Spot spot(Corner... members) const {
    const Corners set = ((1U << corners_[members]) | ...);
    const unsigned owner = owner_of(set);
    const Slots& slots = slots_[(odd_ ? 1 : 0) ^ (std::popcount(owner) & 1)];
    Corners relative = 0;
    Point at = {0, 0, 0};
    for (const unsigned corner : {unsigned{corners_[members]}...}) {
      relative |= 1U << (corner ^ owner);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        at[axis] +=
            static_cast<int>(corner >> axis & 1) * 12 / static_cast<int>(sizeof...(members));
      }
    }
    const auto slot =
        static_cast<unsigned>(std::ranges::find(slots, relative, &Slot::set) - slots.begin());
    return {static_cast<VertexName>(owner * kSlotPlaces + slot), at};
  }

  // From one corner to another.
  Point way(unsigned from, unsigned to) const {
    Point way;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      way[axis] = (corners_[to] >> axis & 1) - (corners_[from] >> axis & 1);
    }
    return way;
  }

  void add(unsigned back, unsigned front, const Point& outward, const Spot& a, Spot b, Spot c) {
    if (dot(normal_of(a.at, b.at, c.at), outward) <= 0) std::swap(b, c);
    walls_.walls[walls_.triangles++] = {{a.name, b.name, c.name}, corners_[back], corners_[front]};
  }

  // Adds the walls between two labels, as the tables for an iso-value have them. The label of the
  // first corner is in front.
  void add_two(const std::array<unsigned, 4>& classes) {
    Corners inside = 0;
    unsigned back = 0;
    for (unsigned i = 0; i < 4; ++i) {
      if (classes[i] == 0) continue;
      inside |= 1U << corners_[i];
      back = i;
    }
    const CellCase cell = tetrahedron_case(corners_, inside);
    for (std::size_t t = 0; t < cell.triangles; ++t) {
      WallTriangle& wall = walls_.walls[walls_.triangles++];
      for (std::size_t v = 0; v < 3; ++v) {
        const EdgeName edge = cell.edges[t][v];
        wall.vertices[v] = static_cast<VertexName>(edge / 8 * kSlotPlaces + edge % 8);
      }
      wall.back = corners_[back];
      wall.front = corners_[0];
    }
  }

  void add_three(const std::array<unsigned, 4>& classes, const std::array<unsigned, 4>& sizes) {
    std::array<unsigned, 4> order = {0, 1, 2, 3};
    std::stable_partition(order.begin(), order.end(),
                          [&](unsigned i) { return sizes[classes[i]] == 2; });
    const auto [a, a2, b, c] = order;
    const Spot face = spot(a, b, c);
    const Spot face2 = spot(a2, b, c);
    add(b, c, way(b, c), spot(b, c), face, face2);
    for (const unsigned single : {b, c}) {
      const Point outward = plus(way(a, single), way(a2, single));
      add(a, single, outward, spot(a, single), spot(a2, single), face2);
      add(a, single, outward, spot(a, single), face2, face);
    }
  }

  // Cut from the edge to the centre, so that points of faces and centres are joined along the lines
  // where walls meet and nowhere else: smoothing relies on that.
  void add_four() {
    const Spot centre = spot(0U, 1U, 2U, 3U);
    for (unsigned i = 0; i < 4; ++i) {
      for (unsigned j = i + 1; j < 4; ++j) {
        const unsigned k = i != 0 ? 0 : j != 1 ? 1 : 2;
        const unsigned l = 6 - i - j - k;
        const Spot edge = spot(i, j);
        add(i, j, way(i, j), edge, spot(i, j, k), centre);
        add(i, j, way(i, j), edge, centre, spot(i, j, l));
      }
    }
  }

  const Tetrahedron& corners_;
  const bool odd_;
  const std::array<Slots, 2>& slots_;
  TetrahedronWalls walls_;
};

// All ways in which four corners may have labels: for each the first one with the same label.
std::vector<std::array<unsigned, 4>> all_classes() {
  std::vector<std::array<unsigned, 4>> all;
  for (unsigned n = 0; n < 24; ++n) {
    const std::array<unsigned, 4> classes = {0, n % 2, n / 2 % 3, n / 6};
    if (std::ranges::all_of(classes, [&](unsigned i) { return classes[i] == i; })) {
      all.push_back(classes);
    }
  }
  return all;
}

}  // namespace

WallCases make_wall_cases(Scheme scheme, bool odd, bool left_handed) {
  const std::array<Slots, 2> slots = {slots_of(cell_split(scheme, false)),
                                      slots_of(cell_split(scheme, true))};
  const CellSplit& split = cell_split(scheme, odd);
  WallCases cases;
  cases.slots = slots[odd ? 1 : 0];
  for (std::size_t s = 0; s < kSlots; ++s) {
    const Corners corners = cases.slots[s].set();
    for (unsigned axes = 0; axes < 8; ++axes) {
      if (corners != 0 && (end_of(corners) & ~axes) == 0) cases.existing[axes] |= 1U << s;
    }
  }
  for (std::size_t t = 0; t < split.tetrahedra; ++t) {
    TetrahedronBuilder builder(split.corners[t], odd, slots);
    for (const std::array<unsigned, 4>& classes : all_classes()) {
      TetrahedronWalls& walls = cases.tetrahedra[t][pattern_of(classes)] = builder.build(classes);
      if (!left_handed) continue;
      for (WallTriangle& wall : walls.walls) std::swap(wall.vertices[1], wall.vertices[2]);
    }
  }
  return cases;
}

}  // namespace isomesh::mesh
