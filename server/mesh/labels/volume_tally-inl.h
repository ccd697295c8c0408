// The walk's parts that tally missing volume. Compiled once for each instruction set, see
// slabs.cpp.
#if defined(ISOMESH_VOLUME_TALLY_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_VOLUME_TALLY_INL_H_
#undef ISOMESH_VOLUME_TALLY_INL_H_
#else
#define ISOMESH_VOLUME_TALLY_INL_H_
#endif

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <tuple>
#include <utility>

#include <hwy/highway.h>

#include "server/mesh/labels/regular_labels-inl.h"
#include "server/mesh/labels/volume_tally.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

// Looks at the cells of one row as if it wrote their triangles.
class TallyCellWriter {
 public:
  TallyCellWriter(const Separation& separation, const LabelRow& row, const EdgeOffsets& offsets,
                  std::uint32_t y, std::uint32_t z, VolumeTally& tally)
      : separation_(separation),
        row_(row),
        offsets_(offsets),
        y_(y),
        z_(z),
        hand_(separation.to_space.determinant() < 0 ? -1 : 1),
        tally_(tally) {}

  Triangle* write(std::size_t x, unsigned /*bit*/, const LabelCells& /*cells*/,
                  const std::uint32_t* places, Triangle* out) const {
    const int borders = is_at_border(x, separation_.dims.x) + is_at_border(y_, separation_.dims.y) +
                        is_at_border(z_, separation_.dims.z);
    if (borders == 0) {
      Sums sums;
      visit_triangles(x, places, [&](const Missing& missing) {
        for (std::size_t k = 0; k < 3; ++k) {
          sums.add(missing.vertices[k], missing.sides, in_units(missing.volumes[k]));
        }
      });
      sums.visit([&](std::uint32_t vertex, WallSides sides, std::int64_t units) {
        add(tally_.fans.find(vertex, {sides, false}), units);
      });
      return out;
    }
    std::array<Missing, kMostTriangles> triangles;
    std::size_t size = 0;
    visit_triangles(x, places, [&](const Missing& missing) { triangles[size++] = missing; });
    give_at_border(std::span(triangles).first(size), borders == 1);
    return out;
  }

 private:
  static constexpr std::size_t kMostTriangles = 6 * std::tuple_size_v<OwedVolumes>;  // of a cell

  // The volumes that the part behind a triangle owes its three corners.
  struct Missing {
    WallSides sides;
    std::array<std::uint32_t, 3> vertices = {};
    std::array<double, 3> volumes = {};

    std::uint32_t fan(const VolumeTally& tally, std::size_t corner) const {
      return tally.fans.find(vertices[corner], {sides, false});
    }
  };

  template <class Visit>
  void visit_triangles(std::size_t x, const std::uint32_t* places, const Visit& visit) const {
    const std::array<PartNumber, 8> labels = row_.labels_at(x);
    const unsigned parity = row_.parity_at(x);
    const CellSplit& split = separation_.splits[parity];
    const TallyCases& cases = tally_.cases[parity];
    const Double4 corner =
        Double4{static_cast<double>(x), static_cast<double>(y_), static_cast<double>(z_), 0} -
        static_cast<double>(separation_.margin);
    for (std::size_t t = 0; t < split.tetrahedra; ++t) {
      const unsigned pattern = pattern_in(labels, split.corners[t]);
      const TetrahedronWalls& walls = separation_.walls[parity].tetrahedra[t][pattern];
      for (std::size_t i = 0; i < walls.triangles; ++i) {
        const WallTriangle& wall = walls.walls[i];
        visit(missing_at(wall, {labels[wall.front], labels[wall.back]},
                         cases.tetrahedra[t][pattern][i], corner, cases, places));
      }
    }
  }

  bool is_at_border(std::size_t at, std::uint32_t samples) const {
    return separation_.margin != 0 && (at == 0 || at + 2 == samples);
  }

  // Caps stay flat and the edges of the volume's box bevelled. So what a cell beyond the samples
  // lacks is owed to those of its vertices in the same wall that may move: within the samples, or
  // else, beyond one face alone, where a wall leaves a cap.
  void give_at_border(std::span<const Missing> triangles, bool is_at_face) const {
    for (auto first = triangles.begin(); first != triangles.end(); ++first) {
      const auto is_same = [&](const Missing& other) { return other.sides == first->sides; };
      if (std::any_of(triangles.begin(), first, is_same)) continue;
      double volume = 0;
      std::array<std::uint32_t, 3 * kMostTriangles> within;
      std::array<std::uint32_t, 3 * kMostTriangles> beyond;
      std::size_t within_size = 0;
      std::size_t beyond_size = 0;
      for (const Missing& missing : triangles) {
        if (!is_same(missing)) continue;
        for (std::size_t k = 0; k < 3; ++k) {
          volume += missing.volumes[k];
          const std::uint32_t fan = missing.fan(tally_, k);
          if (fan == WallFans::kNone) continue;
          const bool is_beyond = tally_.surface.mesh.is_on_border(missing.vertices[k]);
          (is_beyond ? beyond[beyond_size++] : within[within_size++]) = fan;
        }
      }
      const auto share = [&](std::span<const std::uint32_t> fans) {
        for (const std::uint32_t fan : fans) give(fan, volume / static_cast<double>(fans.size()));
      };
      if (within_size > 0) share(std::span(within).first(within_size));
      if (within_size == 0 && is_at_face) share(std::span(beyond).first(beyond_size));
    }
  }

  // What a cell owes to each vertex of a wall. Most of its triangles share few of them, because
  // vertices were joined.
  class Sums {
   public:
    void add(std::uint32_t vertex, WallSides sides, std::int64_t units) {
      const std::uint64_t key =
          std::uint64_t{vertex} << 32 | std::uint64_t{sides.front} << 16 | sides.back;
      std::size_t n = 0;
      while (n < size_ && keys_[n] != key) ++n;
      if (n == size_) {
        keys_[size_] = key;
        units_[size_++] = 0;
      }
      units_[n] += units;
    }
    template <class Visit>
    void visit(Visit visit) const {
      for (std::size_t n = 0; n < size_; ++n) {
        const WallSides sides = {static_cast<PartNumber>(keys_[n] >> 16),
                                 static_cast<PartNumber>(keys_[n])};
        visit(static_cast<std::uint32_t>(keys_[n] >> 32), sides, units_[n]);
      }
    }

   private:
    std::array<std::uint64_t, 3 * kMostTriangles> keys_;
    std::array<std::int64_t, 3 * kMostTriangles> units_;
    std::size_t size_ = 0;
  };

  void give(std::uint32_t fan, double volume) const { add(fan, in_units(volume)); }

  static std::int64_t in_units(double volume) {
    return static_cast<std::int64_t>(volume / VolumeTally::kUnit);
  }

  void add(std::uint32_t fan, std::int64_t units) const {
    if (fan == WallFans::kNone) return;
    std::atomic_ref(tally_.units[fan]).fetch_add(units, std::memory_order_relaxed);
  }

  Missing missing_at(const WallTriangle& triangle, WallSides sides, double owed, Double4 corner,
                     const TallyCases& cases, const std::uint32_t* places) const {
    Missing missing;
    std::array<Double4, 3> before = {};
    std::array<Double4, 3> moved = {};
    for (std::size_t i = 0; i < 3; ++i) {
      const VertexName name = triangle.vertices[i];
      const std::uint32_t vertex = places[offsets_[edge_name(name / kSlotPlaces, 0)] +
                                          static_cast<std::ptrdiff_t>(name % kSlotPlaces)];
      const std::array<float, 3>& place = cases.places[name];
      missing.vertices[i] = vertex;
      before[i] = Double4{double{place[0]}, double{place[1]}, double{place[2]}, 0};
      moved[i] = lanes(tally_.indices[vertex]) - corner - before[i];
    }
    const Double4 normal = swept_normal(before, moved) * hand_;
    const bool is_swapped = sides.front > sides.back;
    if (is_swapped) std::swap(sides.front, sides.back);
    missing.sides = sides;
    Double4 volumes = {};
    for (std::size_t i = 0; i < 3; ++i) {
      const Double4 product = moved[i] * normal;
      volumes[static_cast<int>(i)] = product[0] + product[1] + product[2];
    }
    volumes = owed - volumes / 3.0;
    if (is_swapped) volumes = -volumes;
    for (std::size_t i = 0; i < 3; ++i) missing.volumes[i] = volumes[static_cast<int>(i)];
    return missing;
  }

  static Double4 cross(Double4 a, Double4 b) {
    const auto rotated = [](Double4 v) { return __builtin_shufflevector(v, v, 1, 2, 0, 3); };
    return rotated(a * rotated(b) - rotated(a) * b);
  }

  // The triangle's area vector in the mean over its way: a corner's way times it, a third, is that
  // corner's part of the volume swept.
  static Double4 swept_normal(const std::array<Double4, 3>& at, const std::array<Double4, 3>& way) {
    const Double4 e1 = at[1] - at[0];
    const Double4 e2 = at[2] - at[0];
    const Double4 f1 = way[1] - way[0];
    const Double4 f2 = way[2] - way[0];
    return (cross(e1, e2 + f2 * 0.5) + cross(f1, e2 * 0.5 + f2 * (1 / 3.0))) * 0.5;
  }

  const Separation& separation_;
  const LabelRow row_;
  const EdgeOffsets& offsets_;
  const std::uint32_t y_;
  const std::uint32_t z_;
  const double hand_;  // triangles are wound for space, which a left-handed lattice mirrors
  VolumeTally& tally_;
};

// Numbers vertices as `Base` does, and places none.
template <class Base>
class TallyField : public Base {
 public:
  using Output = VolumeTally;
  static constexpr bool kPlacesVertices = false;

  TallyField(const Separation& separation, std::uint32_t first)
      : Base(separation, first), separation_(separation) {}

  std::uint32_t number_clusters(std::uint32_t y, std::uint32_t z,
                                const std::array<std::uint32_t*, 4>& rows, std::uint32_t vertex,
                                VolumeTally* /*tally*/) {
    return Base::number_clusters(y, z, rows, vertex, nullptr);
  }

  TallyCellWriter cell_writer(std::uint32_t y, std::uint32_t z, const EdgeOffsets& offsets,
                              VolumeTally& tally) const {
    return {separation_, LabelField::row(y, z), offsets, y, z, tally};
  }

  static Mesh& mesh_of(VolumeTally& tally) { return tally.surface.mesh; }

 private:
  const Separation& separation_;
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
