#include "server/mesh/stairs/volume_keeper.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "server/mesh/stairs/waves.h"

namespace isomesh::mesh {
namespace {

// No coordinate moves farther from the start, in samples: what is owed may have no other place.
constexpr float kMostSamples = 1.5F;

// Sums over the triangles of a fan.
struct FanSums {
  Lanes normal = {};   // its length is twice the area
  Lanes between = {};  // of the triangles half-way between those at the start and now, four times
  float area = 0;      // of all, six times

  FanSums(const WallShape& shape, std::size_t fan) {
    struct Ways {
      Lanes now;
      Lanes both;  // at the start, and now
    };
    const Buffer<Lanes>& start = shape.start();
    const std::uint32_t v = shape.fans().vertex(fan);
    const Ways own = {shape.at[v], start[v] + shape.at[v]};
    const auto load = [&](std::uint32_t each) {
      const Lanes at = shape.at[each];
      return Ways{at - own.now, start[each] + at - own.both};
    };
    shape.fans().visit_triangles(fan, load, [&](const Ways& a, const Ways& b) {
      const Lanes here = twisted_cross(a.now, b.now);
      normal += here;
      area += length(here);
      between += twisted_cross(a.both, b.both);
    });
    normal = rotated(normal);
    between = rotated(between);
  }
};

}  // namespace

VolumeKeeper::VolumeKeeper(const WallShape& shape, const Mobility& mobility, Buffer<float> missing,
                           const std::vector<float>& series, const Context& context)
    : shape_(shape), mobility_(mobility), series_(series), context_(context) {
  const WallFans& fans = shape.fans();
  for (const std::size_t block : shape.blocks()) blocks_.push_back(fans.begin(block));
  for (Buffer<float>* const each : {&kept_, &shares_, &areas_}) {
    each->resize_for_overwrite(fans.size());
  }
  normals_.resize_for_overwrite(fans.size());
  for_each(context, fans.size(), [&](std::size_t fan) {
    const std::size_t v = fans.vertex(fan);
    const FanSums sums(shape, fan);
    normals_[fan] = sums.normal;
    areas_[fan] = sums.area / 6;
    const auto count = static_cast<float>(fans.neighbors().degree(fan));
    kept_[fan] = 1 - mobility.spread[v];
    shares_[fan] = mobility.spread[v] / std::max(1.0F, count);
  });
  find_areas();
  // Half-way to the mean, twice: the owner of a vertex has all that its neighbours have a part in.
  constexpr std::array<float, 3> kHalfWays = {0.375F, 0.5F, 0.125F};
  missing_ = spread(std::move(missing), kHalfWays);
}

void VolumeKeeper::hold_curves() {
  holds_curves_ = true;
  find_areas();
}

bool VolumeKeeper::may_move(std::size_t vertex) const {
  return shape_.is_curve(vertex) ? !holds_curves_ : !shape_.is_held(vertex);
}

void VolumeKeeper::find_areas() {
  Buffer<float> room = all_fans();
  for_each(context_, areas_.size(), [&](std::size_t fan) {
    const std::size_t v = shape_.fans().vertex(fan);
    room[fan] = may_move(v) ? areas_[fan] * mobility_.owes[v] : 0;
  });
  room_ = spread(std::move(room), series_);
}

Buffer<float> VolumeKeeper::all_fans() const {
  Buffer<float> values;
  values.resize_for_overwrite(areas_.size());
  return values;
}

Buffer<float> VolumeKeeper::averaged(Buffer<float> values, std::span<const float> series) const {
  const NeighborLists& neighbors = shape_.fans().neighbors();
  Buffer<float> other = all_fans();
  Buffer<float> sum = all_fans();
  const std::array<Buffer<float>*, 2> turns = {&values, &other};  // T[j], by whether j is odd
  in_waves(context_, blocks_, series.size() - 1,
           [&](std::size_t j, std::size_t begin, std::size_t end) {
             const Buffer<float>& now = *turns[(j - 1) % 2];
             Buffer<float>& next = *turns[j % 2];
             for (std::size_t fan = begin; fan < end; ++fan) {
               const float step = shares_[fan] * neighbors.sum(fan, now) + kept_[fan] * now[fan];
               next[fan] = j == 1 ? step : 2 * step - next[fan];
               sum[fan] = (j == 1 ? series[0] * now[fan] : sum[fan]) + series[j] * next[fan];
             }
           });
  return sum;
}

// The adjoint: shares_ times a sum over neighbours becomes the sum of theirs times their values.
Buffer<float> VolumeKeeper::spread(Buffer<float> values, std::span<const float> series) const {
  for_each(context_, values.size(), [&](std::size_t fan) { values[fan] *= shares_[fan]; });
  Buffer<float> result = averaged(std::move(values), series);
  for_each(context_, result.size(), [&](std::size_t fan) { result[fan] /= shares_[fan]; });
  return result;
}

// Along the normals, which are found too.
Buffer<float> VolumeKeeper::offsets(const WallShape& shape, Buffer<Lanes>& normals) const {
  constexpr float kLeastRoom = 0.02F;  // of the area
  constexpr float kLeastFacing = 0.3F;
  // Up to this share of it the area is taken for that at the start. Labels of a few voxels grow
  // more, and by that area they would shrink by too much in turn.
  constexpr float kAlike = 0.65F;
  const WallFans& fans = shape.fans();
  Buffer<float> offsets = all_fans();
  Buffer<float> areas = all_fans();
  for_each(context_, fans.size(), [&](std::size_t fan) {
    const std::size_t v = fans.vertex(fan);
    const FanSums sums(shape, fan);
    // A vertex has a part of the volume that each of its triangles has swept since the start in the
    // direction of its normal: its way times a third of the area vector, in the mean over the way.
    // The parts of the three corners add up to all of it.
    const Lanes way = shape.at[v] - shape.start()[v];
    const float missing = missing_[fan] - dot(way, normals_[fan] + sums.normal + sums.between) / 36;
    normals[fan] = sums.normal / 6.0F;
    const float area = sums.area / 6;
    areas[fan] = holds_curves_ && shape.is_curve(v) ? 0 : area;
    const float grown = areas_[fan] > 0 ? std::max(1.0F, kAlike * area / areas_[fan]) : 1;
    const float room = std::max(grown * room_[fan], kLeastRoom * areas[fan]);
    offsets[fan] = room > 0 ? missing / room : 0;
  });
  offsets = averaged(std::move(offsets), series_);
  for_each(context_, fans.size(), [&](std::size_t fan) {
    const float size = length(normals[fan]);
    if (size <= 0 || areas[fan] <= 0) {
      offsets[fan] = 0;
      return;
    }
    normals[fan] /= size;
    const float most = shape.smallest_spacing();
    const float offset =
        mobility_.owes[fans.vertex(fan)] * offsets[fan] / std::max(kLeastFacing, size / areas[fan]);
    offsets[fan] = std::clamp(offset, -most, most);
  });
  return offsets;
}

// The way whose part along each wall's normal is that wall's offset, as near as may be.
Lanes VolumeKeeper::way_of_curve(const WallShape& shape, std::size_t vertex,
                                 const Buffer<float>& offsets, const Buffer<Lanes>& normals) const {
  constexpr float kDamping = 0.1F;  // where walls lie nearly in one plane
  std::array<Lanes, 3> rows = {Lanes{kDamping, 0, 0, 0}, Lanes{0, kDamping, 0, 0},
                               Lanes{0, 0, kDamping, 0}};
  Lanes goal = {};
  const WallFans& fans = shape.fans();
  for (std::size_t fan = fans.begin(vertex); fan < fans.begin(vertex + 1); ++fan) {
    if (offsets[fan] == 0 && length(normals[fan]) < 0.5F) continue;  // no normal
    for (int i = 0; i < 3; ++i) {
      rows[static_cast<std::size_t>(i)] += normals[fan][i] * normals[fan];
    }
    goal += offsets[fan] * normals[fan];
  }
  const auto& [a, b, c] = rows;
  const Lanes inverse = {dot(goal, cross(b, c)), dot(goal, cross(c, a)), dot(goal, cross(a, b)), 0};
  return shape.kept(vertex, mobility_.calm[vertex] / dot(a, cross(b, c)) * inverse);
}

void VolumeKeeper::restore(WallShape& shape) const {
  Buffer<Lanes> normals;
  normals.resize_for_overwrite(shape.fans().size());
  const Buffer<float> along = offsets(shape, normals);
  for_each(context_, shape.vertices(), [&](std::size_t v) {
    const WallFans& fans = shape.fans();
    if (may_move(v) && shape.is_curve(v)) {
      shape.at[v] += way_of_curve(shape, v, along, normals);
    } else if (may_move(v)) {
      for (std::size_t fan = fans.begin(v); fan < fans.begin(v + 1); ++fan) {
        shape.at[v] += along[fan] * normals[fan];
      }
    }
    shape.hold(v, kMostSamples);
  });
}

}  // namespace isomesh::mesh
