#include "server/mesh/collapse/part_volumes.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

#include "server/mesh/collapse/swept.h"
#include "server/mesh/points.h"

namespace isomesh::mesh::collapse {

PartVolumes::PartVolumes(const Mesh& mesh, std::span<const WallSides> sides) : sides_(sides) {
  PartNumber last = 0;
  for (const WallSides& each : sides) last = std::max({last, each.front, each.back});
  middles_.assign(std::size_t{last} + 1, Point{0, 0, 0});
  std::vector<double> counts(middles_.size(), 0);
  for (std::size_t t = 0; t < sides.size(); ++t) {
    const Point place = to_point(mesh.positions[mesh.triangles[t][0]]);
    for (const PartNumber part : {sides[t].front, sides[t].back}) {
      middles_[part] = plus(middles_[part], place);
      ++counts[part];
    }
  }
  for (std::size_t part = 0; part < middles_.size(); ++part) {
    if (counts[part] > 0) middles_[part] = scaled(middles_[part], 1 / counts[part]);
  }
  volumes_ = volumes(mesh, [&](std::size_t t) { return sides[t]; });
  find_sizes(mesh);
}

// The areas around a closed part cancel each other. The cones of an open one may, too, so a share
// of the ball with its area is the least that counts.
void PartVolumes::find_sizes(const Mesh& mesh) {
  constexpr double kOpen = 1e-3;           // of the area
  constexpr double kLeastRoundness = 0.1;  // of the volume of the ball
  std::vector<Point> sums(volumes_.size(), Point{0, 0, 0});
  std::vector<double> areas(volumes_.size(), 0);
  for (std::size_t t = 0; t < sides_.size(); ++t) {
    const Corners corners = corners_of(mesh, t);
    const Point area = scaled(normal_of(corners[0], corners[1], corners[2]), 0.5);
    sums[sides_[t].back] = plus(sums[sides_[t].back], area);
    sums[sides_[t].front] = minus(sums[sides_[t].front], area);
    for (const PartNumber part : {sides_[t].front, sides_[t].back}) areas[part] += length(area);
  }
  sizes_ = volumes_;
  for (std::size_t part = 0; part < sizes_.size(); ++part) {
    const double ball = std::pow(areas[part], 1.5) / (6 * std::sqrt(std::numbers::pi));
    const bool is_open = length(sums[part]) > kOpen * areas[part];
    sizes_[part] = std::max(std::abs(sizes_[part]), is_open ? kLeastRoundness * ball : 0);
  }
}

// Counter-clockwise from the front, so behind a triangle it counts.
template <class Sides>
std::vector<double> PartVolumes::volumes(const SurfaceView& view, Sides sides_of) const {
  std::vector<double> volumes(middles_.size(), 0);
  if (sides_.empty()) return volumes;
  for (std::size_t t = 0; t < view.triangles.size(); ++t) {
    const WallSides sides = sides_of(t);
    const Corners corners = corners_of(view, t);
    const Point normal = normal_of(corners[0], corners[1], corners[2]);
    volumes[sides.back] += dot(normal, minus(corners[0], middles_[sides.back])) / 6;
    volumes[sides.front] -= dot(normal, minus(corners[0], middles_[sides.front])) / 6;
  }
  return volumes;
}

std::vector<double> PartVolumes::changes(std::span<const Vec3> places,
                                         std::span<const Triangle> triangles,
                                         std::span<const std::uint32_t> numbers) const {
  std::vector<double> changes =
      volumes({places, triangles}, [&](std::size_t n) { return sides_[numbers[n]]; });
  for (std::size_t part = 0; part < changes.size(); ++part) changes[part] -= volumes_[part];
  return changes;
}

std::vector<std::uint8_t> PartVolumes::beyond(double share, std::span<const double> changes) const {
  std::vector<std::uint8_t> are_beyond(changes.size(), 0);
  for (std::size_t part = 1; part < changes.size(); ++part) {
    const bool is_beyond = std::abs(changes[part]) > share * sizes_[part];
    are_beyond[part] = is_beyond ? 1 : 0;
  }
  return are_beyond;
}

std::vector<std::uint32_t> PartVolumes::to_undo(double share, std::span<const double> changes,
                                                const Mesh& mesh, const History& history,
                                                std::span<const Vec3> places) const {
  const std::vector<std::uint8_t> are_beyond = beyond(share, changes);
  std::vector<double> lacking(changes.size(), 0);
  for (std::size_t part = 1; part < changes.size(); ++part) {
    if (are_beyond[part] != 0) lacking[part] = -changes[part];
  }
  struct Swept {
    float volume;  // in front
    std::uint32_t triangle;
  };
  std::vector<Swept> all;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    if (lacking[sides_[t].front] == 0 && lacking[sides_[t].back] == 0) continue;
    const Triangle kept = history.corners_of(mesh.triangles[t]);
    if (kept == mesh.triangles[t]) continue;  // nothing to undo
    Corners to;
    for (std::size_t i = 0; i < 3; ++i) to[i] = to_point(places[kept[i]]);
    const auto [a, b, c] = swept(corners_of(mesh, t), to);
    all.push_back({static_cast<float>(a + b + c), t});
  }
  std::ranges::sort(all, [](const Swept& a, const Swept& b) {
    return std::pair(-std::abs(a.volume), a.triangle) < std::pair(-std::abs(b.volume), b.triangle);
  });
  // An undone triangle gives the front its volume back, and takes it from the part behind.
  const auto give = [](double volume, double& lack) {
    if (!(volume * lack > 0)) return false;
    lack = std::abs(lack) > std::abs(volume) ? lack - volume : 0;
    return true;
  };
  std::vector<std::uint32_t> which;
  for (const auto& [volume, triangle] : all) {
    const bool is_for_front = give(double{volume}, lacking[sides_[triangle].front]);
    const bool is_for_back = give(-double{volume}, lacking[sides_[triangle].back]);
    if (is_for_front || is_for_back) which.push_back(triangle);
  }
  return which;
}

}  // namespace isomesh::mesh::collapse
