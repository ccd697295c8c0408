#include "server/mesh/stairs/volume_keeper.h"

#include <algorithm>
#include <cmath>

namespace isomesh::mesh {
namespace {

// A vertex's part of the volume that one of its triangles has swept since the start, in the
// direction of its normal. The parts of the three corners add up to all of it.
float swept(const WallShape& shape, std::size_t v, const Spoke& spoke) {
  const std::vector<Lanes>& start = shape.start();
  const Lanes e1 = start[spoke.next] - start[v];
  const Lanes e2 = start[spoke.previous] - start[v];
  const Lanes way = shape.at[v] - start[v];
  const Lanes f1 = shape.at[spoke.next] - start[spoke.next] - way;
  const Lanes f2 = shape.at[spoke.previous] - start[spoke.previous] - way;
  // Twice the area vector, in the mean over the way.
  const Lanes area = cross(e1, e2 + 0.5F * f2) + cross(f1, 0.5F * e2 + (1 / 3.0F) * f2);
  return dot(way, area) / 6;
}

}  // namespace

VolumeKeeper::VolumeKeeper(const WallShape& shape, const Mobility& mobility,
                           const std::vector<float>& missing, const std::vector<float>& series,
                           const Context& context)
    : shape_(shape),
      mobility_(mobility),
      missing_(missing),
      series_(series),
      context_(context),
      kept_(shape.fans().size()),
      shares_(shape.fans().size()),
      areas_(shape.fans().size()) {
  const WallFans& fans = shape.fans();
  for_each(context, fans.size(), [&](std::size_t fan) {
    const std::size_t v = fans.vertex(fan);
    float area = 0;
    for (const Spoke& spoke : fans.spokes(fan)) area += length(shape.normal(v, spoke)) / 6;
    areas_[fan] = area;
    const auto count = static_cast<float>(fans.neighbors(fan).size());
    kept_[fan] = 1 - mobility.spread[v];
    shares_[fan] = mobility.spread[v] / std::max(1.0F, count);
  });
  find_areas();
}

void VolumeKeeper::hold_curves() {
  holds_curves_ = true;
  find_areas();
}

bool VolumeKeeper::may_move(std::size_t vertex) const {
  return shape_.is_curve(vertex) ? !holds_curves_ : !shape_.is_held(vertex);
}

void VolumeKeeper::find_areas() {
  std::vector<float> room(areas_.size());
  for_each(context_, areas_.size(), [&](std::size_t fan) {
    const std::size_t v = shape_.fans().vertex(fan);
    room[fan] = may_move(v) ? areas_[fan] * mobility_.owes[v] : 0;
  });
  room_ = diffused(std::move(room), Way::kSpread);
}

std::vector<float> VolumeKeeper::diffused(std::vector<float> values, Way way) const {
  const WallFans& fans = shape_.fans();
  std::vector<float> before(values.size());  // T[j - 2], then T[j]; values is T[j - 1]
  std::vector<float> sum(values.size());
  std::vector<float> given(way == Way::kSpread ? values.size() : 0);
  for (std::size_t i = 0; i < values.size(); ++i) sum[i] = series_[0] * values[i];
  for (std::size_t j = 1; j < series_.size(); ++j) {
    const float twice = j == 1 ? 1 : 2;
    if (way == Way::kSpread) {
      for_each(context_, values.size(),
               [&](std::size_t fan) { given[fan] = values[fan] * shares_[fan]; });
    }
    const std::vector<float>& from = way == Way::kSpread ? given : values;
    for_each(context_, values.size(), [&](std::size_t fan) {
      float mean = 0;
      for (const std::uint32_t neighbor : fans.neighbors(fan)) mean += from[neighbor];
      if (way == Way::kAverage) mean *= shares_[fan];
      before[fan] = twice * (mean + kept_[fan] * values[fan]) - before[fan];
      sum[fan] += series_[j] * before[fan];
    });
    before.swap(values);
  }
  return sum;
}

// Along the normals, which are found too.
std::vector<float> VolumeKeeper::offsets(const WallShape& shape,
                                         std::vector<Lanes>& normals) const {
  constexpr float kLeastRoom = 0.02F;  // of the area
  constexpr float kLeastFacing = 0.3F;
  // Up to this share of it the area is taken for that at the start. Labels of a few voxels grow
  // more, and by that area they would shrink by too much in turn.
  constexpr float kAlike = 0.6F;
  const WallFans& fans = shape.fans();
  std::vector<float> offsets(fans.size());
  std::vector<float> areas(fans.size());
  for_each(context_, fans.size(), [&](std::size_t fan) {
    const std::size_t v = fans.vertex(fan);
    float missing = missing_[fan];
    float area = 0;
    Lanes normal = {};
    for (const Spoke& spoke : fans.spokes(fan)) {
      missing -= swept(shape, v, spoke);
      const Lanes sixth = shape.normal(v, spoke) / 6.0F;
      normal += sixth;
      area += length(sixth);
    }
    normals[fan] = normal;
    areas[fan] = holds_curves_ && shape.is_curve(v) ? 0 : area;
    const float grown = areas_[fan] > 0 ? std::max(1.0F, kAlike * area / areas_[fan]) : 1;
    const float room = std::max(grown * room_[fan], kLeastRoom * areas[fan]);
    offsets[fan] = room > 0 ? missing / room : 0;
  });
  offsets = diffused(std::move(offsets), Way::kAverage);
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
                                 const std::vector<float>& offsets,
                                 const std::vector<Lanes>& normals) const {
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
  std::vector<Lanes> normals(shape.fans().size());
  const std::vector<float> along = offsets(shape, normals);
  for_each(context_, shape.vertices(), [&](std::size_t v) {
    if (!may_move(v)) return;
    if (shape.is_curve(v)) {
      shape.at[v] += way_of_curve(shape, v, along, normals);
      return;
    }
    const WallFans& fans = shape.fans();
    for (std::size_t fan = fans.begin(v); fan < fans.begin(v + 1); ++fan) {
      shape.at[v] += along[fan] * normals[fan];
    }
  });
}

}  // namespace isomesh::mesh
