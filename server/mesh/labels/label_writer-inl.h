// The field of labels for the walk that writes, as regular-inl.h has that of an iso-value. Compiled
// once for each instruction set, see slabs.cpp.
#if defined(ISOMESH_LABEL_WRITER_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_LABEL_WRITER_INL_H_
#undef ISOMESH_LABEL_WRITER_INL_H_
#else
#define ISOMESH_LABEL_WRITER_INL_H_
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <utility>
#include <vector>

#include <hwy/highway.h>

#include "server/mesh/extract/joined_rows-inl.h"
#include "server/mesh/extract/links.h"
#include "server/mesh/labels/labels-inl.h"
#include "server/mesh/labels/star_points.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

// Writes the triangles of the cells of one row, and what is on their sides. Where there are
// clusters, it leaves triangles out of which two corners are one vertex.
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
    Triangle* const end = separation_.clusters.empty()
                              ? write_case(cell, places, offsets_, out)
                              : write_kept(cell, places, offsets_, end_, out);
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
        if (a == b || b == c || c == a) continue;
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

class LabelWriter {
 public:
  using Marched = Separation;
  using Output = SeparatingSurface;
  using Cells = LabelCells;
  static constexpr std::size_t kPlaces = kSlotPlaces;
  static constexpr bool kHasLines = true;
  static constexpr bool kHasClusters = true;

  LabelWriter(const Separation& separation, std::uint32_t first)
      : separation_(separation),
        links_(links_of(separation.scheme)),
        field_(separation, first),
        joined_(separation.dims, first) {
    for (unsigned parity = 0; parity < 2; ++parity) {
      const StarPoints& points = star_points(separation.scheme)[parity];
      for (std::size_t kind = 0; kind < points.size(); ++kind) {
        for (const StarPoint& point : points[kind]) {
          points_[parity][kind].push_back(placed(point, parity));
        }
      }
      for (std::size_t d = 0; d < points[0].size(); ++d) {
        const StarPoint& edge = points[0][d];
        const unsigned owner = edge.owner_parity(parity);
        const bool is_second = separation.walls[owner].slots[edge.slot].corners[1] == edge.corner;
        ways_[owner][edge.slot][is_second ? 1 : 0] = edge.neighbours;
      }
    }
  }

  void reach(std::uint32_t z) { field_.reach(z); }
  LabelRow row(std::uint32_t y, std::uint32_t z) const {
    return field_.row(y, z, joined_.row(y, z));
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
    const auto corners = std::span(slot.corners).first(slot.size);
    const std::array<std::uint32_t, 3> cell = {x, y, z};
    const Dims& dims = separation_.dims;
    const std::array<std::uint32_t, 3> ends = {dims.x - 1, dims.y - 1, dims.z - 1};
    const LatticeToSpace& map = separation_.to_space;
    // In the lattice's own numbers, in the order of place_inner for the same bits.
    const Double4 at = row_origin(map, static_cast<double>(y) - 1, static_cast<double>(z) - 1) +
                       lanes(map.step_x) * (static_cast<double>(x) - 1);
    Double4 exact = at + frame.start + frame.run * 0.5;
    BorderVertex vertex;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto is_at = [&, axis](std::uint32_t plane) {
        return [&, axis, plane](unsigned corner) {
          return cell[axis] + (corner >> axis & 1) == plane;
        };
      };
      for (const auto& [outer, face] : {std::pair(0U, 1U), std::pair(ends[axis], ends[axis] - 1)}) {
        vertex.on_border = vertex.on_border || std::ranges::all_of(corners, is_at(face));
        const auto phantom = std::ranges::find_if(corners, is_at(outer));
        if (phantom == corners.end()) continue;
        vertex.on_border = true;
        Double4 others = {};
        for (const std::uint8_t corner : corners) {
          if (corner != *phantom) others += space_offset(map, corner);
        }
        exact = at + (others / (slot.size - 1.0) + space_offset(map, *phantom)) * 0.5;
      }
    }
    for (std::size_t i = 0; i < 3; ++i) vertex.position[i] = static_cast<float>(exact[i]);
    return vertex;
  }

  // Tells the owners of vertices that samples of a row name, in the places `vertices`. `first` is
  // the first one's number.
  void tell_owners(std::uint32_t y, std::uint32_t z, std::span<const std::uint32_t> vertices,
                   std::uint32_t first, SeparatingSurface& surface) const {
    const LabelRow row = field_.row(y, z);
    VertexOwner* out = surface.owners.data() + first;
    for (const std::uint32_t vertex : vertices) {
      const std::uint32_t x = vertex / kPlaces;
      const std::size_t place = vertex % kPlaces;
      const unsigned parity = row.parity_at(x);
      const Slot& slot = separation_.walls[parity].slots[place];
      std::size_t owner = 0;
      PartNumber most = 0;
      for (std::size_t i = 0; i < slot.size; ++i) {
        const PartNumber label = row.label(slot.corners[i], x);
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

  LabelCellWriter cell_writer(std::uint32_t y, std::uint32_t z, const EdgeOffsets& offsets,
                              SeparatingSurface& surface) const {
    return {separation_, field_.row(y, z), offsets, z, surface};
  }

  // Like ClusteredField::number_clusters, but for the slots of samples. Also marks the vertices on
  // junction curves.
  std::uint32_t number_clusters(std::uint32_t y, std::uint32_t z,
                                const std::array<std::uint32_t*, 4>& rows, std::uint32_t vertex,
                                SeparatingSurface* surface) {
    if (separation_.clusters.empty()) return vertex;
    joined_.mark(
        separation_.clusters, y, z,
        [&](const JoiningPlace& at, const Joined& joined, const JoinedPoints* points, auto visit) {
          visit_points(separation_.parity(at.x, at.row, at.z), sets_of(joined.directions(), points),
                       [&](const PlacedPoint& point) { visit(point.name); });
        });
    const LatticeToSpace& map = separation_.to_space;
    const double margin = separation_.margin;
    const Double4 row_at = row_origin(map, y - margin, z - margin);
    visit_joining(
        separation_.clusters, y, z,
        [&](std::uint32_t x, const Joined& all, const JoinedPoints* points) {
          const unsigned parity = separation_.parity(x, y, z);
          const Double4 at = row_at + lanes(map.step_x) * (static_cast<double>(x) - margin);
          Directions joined = all.directions();
          while (joined != 0) {
            const Directions component =
                all.is_one() ? joined : links_.facts(parity, joined).first();
            joined &= ~component;
            const PointSets sets = sets_of(component, points);
            visit_points(parity, sets, [&](const PlacedPoint& point) {
              const JoinedName& name = point.name;
              rows[name.row][(x - name.before) * kSlotPlaces + name.place] = vertex;
            });
            if (surface != nullptr) {
              const Float4 position = __builtin_convertvector(at + mean(parity, sets), Float4);
              Mesh& mesh = surface->mesh;
              std::memcpy(&mesh.positions[vertex], &position, sizeof mesh.positions[vertex]);
              if ((sets[1] | sets[2]) != 0) set_flag(mesh.on_line, vertex);
              VertexOwner& owner = surface->owners[vertex];
              owner = {};
              owner.sample = sample_at(x, y, z);
              owner.directions = component;
              owner.is_whole = all.is_whole() ? 1 : 0;
            }
            ++vertex;
          }
        });
    return vertex;
  }

 private:
  struct PlacedPoint {
    JoinedName name;
    StoredDouble4 offset = {};  // from the sample, in millimetres
  };
  // Some points around a sample: of each kind of StarPoints a bit for each.
  using PointSets = std::array<std::uint64_t, 3>;

  PlacedPoint placed(const StarPoint& point, unsigned parity) const {
    if (point.neighbours == 0) return {};
    // Placed by the owner of the name, so that positions are identical to the bit.
    const EdgeFrame frame = LabelWriter::frame(point.owner_parity(parity), point.slot);
    return {{static_cast<std::uint8_t>(point.corner >> 1),
             static_cast<std::uint8_t>(point.corner & 1), point.slot},
            frame.start - space_offset(separation_.to_space, point.corner) + frame.run * 0.5};
  }

  static PointSets sets_of(Directions edges, const JoinedPoints* points) {
    if (points == nullptr) return {edges, 0, 0};
    return {edges, (*points)[0], (*points)[1]};
  }

  template <class Visit>
  void visit_points(unsigned parity, const PointSets& sets, Visit visit) const {
    for (std::size_t kind = 0; kind < sets.size(); ++kind) {
      for (std::uint64_t rest = sets[kind]; rest != 0; rest &= rest - 1) {
        visit(points_[parity][kind][static_cast<std::size_t>(std::countr_zero(rest))]);
      }
    }
  }

  // The mean of the centres among them, or else of the points in faces, or else of the crossings.
  Double4 mean(unsigned parity, const PointSets& sets) const {
    const std::size_t kind = sets[2] != 0 ? 2 : sets[1] != 0 ? 1 : 0;
    PointSets chosen = {};
    chosen[kind] = sets[kind];
    Double4 sum = {};
    visit_points(parity, chosen, [&](const PlacedPoint& point) { sum += point.offset; });
    return sum / static_cast<double>(std::popcount(sets[kind]));
  }

  // In the lattice's own numbers, where phantoms are numbered too.
  std::uint64_t sample_at(std::uint32_t x, std::uint32_t y, std::uint32_t z) const {
    const Dims& inner = separation_.samples->dims();
    const std::uint32_t margin = separation_.margin;
    return (std::uint64_t{z - margin} * inner.y + (y - margin)) * inner.x + (x - margin);
  }

  const Separation& separation_;
  const Links& links_;
  LabelField field_;
  JoinedRows<std::uint32_t> joined_;
  // Indexed by parity; in the order of star_points.h.
  std::array<std::array<std::vector<PlacedPoint>, 3>, 2> points_;
  // By parity and place of an edge: its direction from its first end, and from its second.
  std::array<std::array<std::array<Directions, 2>, kEdgePlaces>, 2> ways_ = {};
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
