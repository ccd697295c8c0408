#include "server/mesh/labels/missing_volume.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <vector>

#include "server/mesh/extract/slab_passes.h"
#include "server/mesh/labels/volume_tally.h"
#include "server/mesh/parallel.h"
#include "server/mesh/points.h"

namespace isomesh::mesh {
namespace {

using Corners = std::array<std::uint8_t, 4>;
using Places = std::array<std::array<float, 3>, 8 * kSlotPlaces>;

Point corner_at(unsigned corner) {
  return {static_cast<double>(corner & 1), static_cast<double>(corner >> 1 & 1),
          static_cast<double>(corner >> 2 & 1)};
}

Places places_of(const std::array<WallCases, 2>& walls, unsigned parity) {
  Places places = {};
  for (unsigned owner = 0; owner < 8; ++owner) {
    const WallCases& cases = walls[(parity + static_cast<unsigned>(std::popcount(owner))) & 1];
    for (std::size_t s = 0; s < kSlots; ++s) {
      const Slot& slot = cases.slots[s];
      for (std::size_t axis = 0; slot.size > 0 && axis < 3; ++axis) {
        double sum = 0;
        for (std::size_t i = 0; i < slot.size; ++i) sum += corner_at(slot.corners[i])[axis];
        places[owner * kSlotPlaces + s][axis] =
            static_cast<float>(corner_at(owner)[axis] + sum / slot.size);
      }
    }
  }
  return places;
}

double volume_of(const Corners& corners) {
  const Point origin = corner_at(corners[0]);
  const auto way = [&](std::size_t i) { return minus(corner_at(corners[i]), origin); };
  return std::abs(dot(way(1), cross(way(2), way(3)))) / 6;
}

// How much of the voxels of its corners a tetrahedron has: of each, its share of the cell's eighth
// around that corner. The tetrahedra of one cell have all of that eighth, so the shares are right
// in the outermost cells, too. Of Kuhn's six, all have the ends of the cell's long diagonal, and
// two each of the other corners. Of the five, one has a corner whose edges are the cell's own.
std::array<double, 4> shares_of(const Corners& corners, Scheme scheme) {
  std::array<double, 4> shares;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto edges_along = [&](int axes) {
      return std::ranges::count_if(corners, [&](std::uint8_t other) {
        return std::popcount(unsigned{other} ^ corners[i]) == axes;
      });
    };
    if (scheme != Scheme::kFive) {
      shares[i] = edges_along(3) == 1 ? 1 / 48.0 : 1 / 16.0;
    } else if (edges_along(1) == 3) {
      shares[i] = 1 / 8.0;
    } else {
      shares[i] = edges_along(1) == 1 ? 1 / 72.0 : 1 / 12.0;
    }
  }
  return shares;
}

class TetrahedronDebt {
 public:
  TetrahedronDebt(const Corners& corners, unsigned pattern, const TetrahedronWalls& walls,
                  const Places& places)
      : corners_(corners), classes_(classes_of(pattern)), walls_(walls), places_(places) {}

  OwedVolumes owed(Scheme scheme) const {
    const std::array<double, 4> shares = shares_of(corners_, scheme);
    std::array<double, 4> missing = volumes();
    for (double& volume : missing) volume = -volume;
    for (std::size_t i = 0; i < 4; ++i) missing[classes_[i]] += shares[i];
    OwedVolumes owed = {};
    for (std::size_t t = 0; t < walls_.triangles; ++t) {
      const WallTriangle& wall = walls_.walls[t];
      const auto of_wall =
          std::ranges::count_if(walls_.walls.begin(), walls_.walls.begin() + walls_.triangles,
                                [&](const WallTriangle& other) { return is_same(wall, other); });
      const double owed_to_back = missing[class_of(wall.back)] - missing[class_of(wall.front)];
      owed[t] = static_cast<float>(owed_to_back / static_cast<double>(labels()) /
                                   (3.0 * static_cast<double>(of_wall)));
    }
    return owed;
  }

 private:
  std::size_t class_of(unsigned corner) const {
    return classes_[static_cast<std::size_t>(std::ranges::find(corners_, corner) -
                                             corners_.begin())];
  }

  bool is_same(const WallTriangle& a, const WallTriangle& b) const {
    const auto [low, high] = std::minmax({class_of(a.back), class_of(a.front)});
    return std::pair(low, high) == std::pair(std::minmax({class_of(b.back), class_of(b.front)}));
  }

  std::size_t size_of(std::size_t label) const {
    return static_cast<std::size_t>(std::ranges::count(classes_, label));
  }

  std::size_t labels() const {
    std::size_t count = 0;
    for (std::size_t i = 0; i < 4; ++i) count += size_of(i) > 0 ? 1 : 0;
    return count;
  }

  // The volume that the walls leave each label, by class. A label with one corner is the cone from
  // there to its walls; two and two have half each, since one is the other's image; the last has
  // the rest.
  std::array<double, 4> volumes() const {
    std::array<double, 4> volumes = {};
    double rest = volume_of(corners_);
    std::size_t largest = 0;
    for (std::size_t label = 0; label < 4; ++label) {
      if (size_of(label) > size_of(largest)) largest = label;
    }
    for (std::size_t label = 0; label < 4; ++label) {
      if (label == largest || size_of(label) == 0) continue;
      volumes[label] = size_of(label) == 2 ? rest / 2 : cone(label);
      rest -= volumes[label];
    }
    volumes[largest] = rest;
    return volumes;
  }

  double cone(std::size_t label) const {
    const Point apex = corner_at(corners_[label]);
    double volume = 0;
    for (std::size_t t = 0; t < walls_.triangles; ++t) {
      const WallTriangle& wall = walls_.walls[t];
      if (class_of(wall.back) != label && class_of(wall.front) != label) continue;
      const auto way = [&](std::size_t i) {
        return minus(to_point(places_[wall.vertices[i]]), apex);
      };
      volume += std::abs(dot(way(0), cross(way(1), way(2)))) / 6;
    }
    return volume;
  }

  const Corners& corners_;
  const std::array<unsigned, 4> classes_;
  const TetrahedronWalls& walls_;
  const Places& places_;
};

Buffer<Point> indices_of(const LatticeToSpace& to_space, const Mesh& mesh, const Context& context) {
  const Point origin = index_of(to_space, {0, 0, 0});
  std::array<Point, 3> axes;
  // The difference of two indices has few digits if the way between them is much shorter than a
  // step.
  const double mm = unit_mm(to_space);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    Point unit = {0, 0, 0};
    unit[axis] = mm;
    axes[axis] = minus(index_of(to_space, unit), origin);
    for (double& part : axes[axis]) part /= mm;
  }
  Buffer<Point> indices;
  indices.resize_for_overwrite(mesh.positions.size());
  for_each(context, indices.size(), [&](std::size_t v) {
    Point& index = indices[v] = origin;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (std::size_t i = 0; i < 3; ++i) index[i] += axes[axis][i] * mesh.positions[v][axis];
    }
  });
  return indices;
}

}  // namespace

std::array<TallyCases, 2> make_tally_cases(Scheme scheme, const std::array<WallCases, 2>& walls) {
  std::array<TallyCases, 2> all;
  for (unsigned parity = 0; parity < 2; ++parity) {
    TallyCases& cases = all[parity];
    cases.places = places_of(walls, parity);
    const CellSplit& split = cell_split(scheme, parity != 0);
    for (std::size_t t = 0; t < split.tetrahedra; ++t) {
      for (unsigned pattern = 0; pattern < kPatterns; ++pattern) {
        const TetrahedronWalls& own = walls[parity].tetrahedra[t][pattern];
        if (own.triangles == 0) continue;
        cases.tetrahedra[t][pattern] =
            TetrahedronDebt(split.corners[t], pattern, own, cases.places).owed(scheme);
      }
    }
  }
  return all;
}

template <class T>
Buffer<float> missing_volume(const Lattice<T>& lattice, const SeparateOptions& options,
                             const SurfaceCount& count, const WallFans& fans,
                             const Context& context, SeparatingSurface& surface) {
  Buffer<float> voxels;
  voxels.resize_for_overwrite(fans.size());
  if (fans.size() == 0) return voxels;
  Separation separation(lattice, options);
  separation.clusters = count.clusters;
  const std::array<TallyCases, 2> cases = make_tally_cases(options.scheme, separation.walls);
  std::vector<std::int64_t> units(fans.size(), 0);
  const Buffer<Point> indices = indices_of(lattice.to_space, surface.mesh, context);
  VolumeTally tally = {surface, fans, cases, indices.span(), units};
  write_pass(separation, kSlotPlaces, context, surface.mesh, tally);
  for (std::size_t fan = 0; fan < units.size(); ++fan) {
    voxels[fan] = static_cast<float>(static_cast<double>(units[fan]) * VolumeTally::kUnit);
  }
  return voxels;
}

#define ISOMESH_INSTANTIATE(T)                                                                \
  template Buffer<float> missing_volume(const Lattice<T>&, const SeparateOptions&,            \
                                        const SurfaceCount&, const WallFans&, const Context&, \
                                        SeparatingSurface&);
ISOMESH_FOR_EACH_LABEL_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::mesh
