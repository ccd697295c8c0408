// The walk's parts for labels whose surface is regularised, as regular-inl.h has them for an
// iso-value. Compiled once for each instruction set, see slabs.cpp.
#if defined(ISOMESH_REGULAR_LABELS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_REGULAR_LABELS_INL_H_
#undef ISOMESH_REGULAR_LABELS_INL_H_
#else
#define ISOMESH_REGULAR_LABELS_INL_H_
#endif

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include <hwy/highway.h>

#include "server/mesh/extract/joined_rows-inl.h"
#include "server/mesh/extract/links.h"
#include "server/mesh/labels/labels-inl.h"
#include "server/mesh/labels/star_points.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

// A row without the vertices that clusters have instead of its slots.
class RegularLabelRow : public LabelRow {
 public:
  // `joined`: for each sample the set of its slots that are some cluster's.
  RegularLabelRow(const LabelRow& row, const std::uint32_t* joined)
      : LabelRow(row), joined_(joined) {}

  HWY_INLINE std::uint32_t* list(std::size_t x, unsigned bit, const LabelCells& cells,
                                 std::uint32_t* next) const {
    return list_without(joined_[x], x, bit, cells, next);
  }

 private:
  const std::uint32_t* joined_;
};

class RegularLabelField : public LabelField {
 public:
  using Row = RegularLabelRow;
  static constexpr bool kHasClusters = true;

  RegularLabelField(const Separation& separation, std::uint32_t first)
      : LabelField(separation, first),
        separation_(separation),
        links_(links_of(separation.scheme)),
        joined_(separation.dims, first) {
    for (unsigned parity = 0; parity < 2; ++parity) {
      const StarPoints& points = star_points(separation.scheme)[parity];
      for (const StarPoint& point : points.edges) edges_[parity].push_back(placed(point, parity));
      for (const StarPoint& point : points.faces) faces_[parity].push_back(placed(point, parity));
      for (const StarPoint& point : points.centres) {
        centres_[parity].push_back(placed(point, parity));
      }
    }
  }

  RegularLabelRow row(std::uint32_t y, std::uint32_t z) const {
    return {LabelField::row(y, z), joined_.row(y, z)};
  }

  LabelCellWriter<true> cell_writer(std::uint32_t y, std::uint32_t z, const EdgeOffsets& offsets,
                                    SeparatingSurface& surface) const {
    return {separation_, LabelField::row(y, z), offsets, z, surface};
  }

  // Like RegularField::number_clusters, but for the slots of samples. Also marks the vertices on
  // junction curves.
  std::uint32_t number_clusters(std::uint32_t y, std::uint32_t z,
                                const std::array<std::uint32_t*, 4>& rows, std::uint32_t vertex,
                                SeparatingSurface* surface) {
    joined_.mark(
        separation_.clusters, y, z,
        [&](const JoiningPlace& at, const Joined& joined, const JoinedPoints* points, auto visit) {
          const unsigned parity = separation_.parity(at.x, at.row, at.z);
          visit_points(parity, joined.directions(), points,
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
            visit_points(parity, component, points, [&](const PlacedPoint& point) {
              const JoinedName& name = point.name;
              rows[name.row][(x - name.before) * kSlotPlaces + name.place] = vertex;
            });
            if (surface != nullptr) {
              const bool is_on_line = points != nullptr && (points->faces | points->centres) != 0;
              place(at + mean(parity, component, points), is_on_line, vertex, surface->mesh);
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

  PlacedPoint placed(const StarPoint& point, unsigned parity) const {
    if (point.neighbours == 0) return {};
    const unsigned owner = (parity + static_cast<unsigned>(std::popcount(point.corner))) & 1;
    // Placed by the owner of the name, so that positions are identical to the bit.
    const EdgeFrame frame = LabelField::frame(owner, point.slot);
    return {{static_cast<std::uint8_t>(point.corner >> 1),
             static_cast<std::uint8_t>(point.corner & 1), point.slot},
            frame.start - space_offset(separation_.to_space, point.corner) + frame.run * 0.5};
  }

  // Calls visit(point) for all that a sample joins in some directions.
  template <class Visit>
  void visit_points(unsigned parity, Directions joined, const JoinedPoints* points,
                    Visit visit) const {
    const auto visit_members = [&](std::uint64_t members, const std::vector<PlacedPoint>& all) {
      for (; members != 0; members &= members - 1) {
        visit(all[static_cast<std::size_t>(std::countr_zero(members))]);
      }
    };
    visit_members(joined, edges_[parity]);
    if (points == nullptr) return;
    visit_members(points->faces, faces_[parity]);
    visit_members(points->centres, centres_[parity]);
  }

  // The mean of the centres among them, or else of the points in faces, or else of the crossings.
  Double4 mean(unsigned parity, Directions joined, const JoinedPoints* points) const {
    const auto mean_of = [](std::uint64_t members, const std::vector<PlacedPoint>& all) {
      const auto count = static_cast<double>(std::popcount(members));
      Double4 sum = {};
      for (; members != 0; members &= members - 1) {
        sum += all[static_cast<std::size_t>(std::countr_zero(members))].offset;
      }
      return sum / count;
    };
    if (points != nullptr && points->centres != 0)
      return mean_of(points->centres, centres_[parity]);
    if (points != nullptr && points->faces != 0) return mean_of(points->faces, faces_[parity]);
    return mean_of(joined, edges_[parity]);
  }

  static void place(Double4 at, bool is_on_line, std::uint32_t vertex, Mesh& mesh) {
    const Float4 position = __builtin_convertvector(at, Float4);
    std::memcpy(&mesh.positions[vertex], &position, sizeof mesh.positions[vertex]);
    if (is_on_line) set_flag(mesh.on_line, vertex);
  }

  const Separation& separation_;
  const Links& links_;
  JoinedRows<std::uint32_t> joined_;
  // Indexed by parity; each list is in the order of star_points.h.
  std::array<std::vector<PlacedPoint>, 2> edges_;
  std::array<std::vector<PlacedPoint>, 2> faces_;
  std::array<std::vector<PlacedPoint>, 2> centres_;
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
