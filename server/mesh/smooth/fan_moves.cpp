// Compiled once for each instruction set: this file includes itself through Highway's
// foreach_target.h. The compiler makes wide registers of eight lanes.
#include "server/mesh/smooth/fan_moves.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "server/mesh/smooth/fan_moves.cpp"
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <vector>

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "server/mesh/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

// Fans with a smaller angle are optimised. Freitag's combination leaves the others to the mean.
constexpr float kCosOfSmall = 0.906307787F;  // 25 degrees
constexpr float kLeastGain = 1e-4F;          // in the cosine of the smallest angle
constexpr float kNearSurface = 0.02F;        // of the mean edge length: not put back
constexpr float kMostOff = 0.1F;             // of the mean edge length
constexpr float kFar = 1e30F;
constexpr int kMostWalks = 6;  // from one home to the next

// The triangles around kLanes vertices, as seen from those. A lane with fewer neighbours than the
// others has its first one again and again, and its last triangles have no area.
struct Fan {
  std::array<std::uint32_t, kLanes> vertices;
  Mask live;
  std::size_t size = 0;
  Lanes count;
  Lanes3 at;
  std::array<Lanes3, Rings::kMostNeighbors> spokes;
  Lanes3 normal;      // of length 1
  Lanes mean_length;  // of the spokes

  const Lanes3& next(std::size_t spoke) const { return spokes[spoke + 1 == size ? 0 : spoke + 1]; }
};

// `position(lane)` is a point.
template <class Position>
HWY_INLINE Lanes3 gather(Position position) {
  std::array<std::array<float, kLanes>, 3> axes;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const Vec3& at = position(lane);
    for (std::size_t axis = 0; axis < 3; ++axis) axes[axis][lane] = at[axis];
  }
  Lanes3 result;
  std::memcpy(&result.x, axes[0].data(), sizeof result.x);
  std::memcpy(&result.y, axes[1].data(), sizeof result.y);
  std::memcpy(&result.z, axes[2].data(), sizeof result.z);
  return result;
}

HWY_INLINE Lanes3 gather(const Vec3* positions, const std::array<std::uint32_t, kLanes>& vertices) {
  return gather([&](std::size_t lane) -> const Vec3& { return positions[vertices[lane]]; });
}

// The positions of the neighbours of each lane's vertex, less `origin`. Returns the largest number.
HWY_INLINE std::size_t gather_ring(const Rings& rings, const Vec3* positions,
                                   const std::array<std::uint32_t, kLanes>& vertices,
                                   const Lanes3& origin, Lanes3* out, Lanes* count) {
  std::array<std::span<const std::uint32_t>, kLanes> around;
  std::size_t size = 0;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    around[lane] = rings.around(vertices[lane]);
    size = std::max(size, around[lane].size());
    if (count != nullptr) (*count)[lane] = static_cast<float>(around[lane].size());
  }
  for (std::size_t spoke = 0; spoke < size; ++spoke) {
    out[spoke] = gather([&](std::size_t lane) -> const Vec3& {
                   return positions[around[lane][spoke < around[lane].size() ? spoke : 0]];
                 }) -
                 origin;
  }
  return size;
}

HWY_INLINE void gather_fan(const FanMoves& moves, std::span<const std::uint32_t> vertices,
                           Fan& fan) {
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    fan.vertices[lane] = vertices[std::min(lane, vertices.size() - 1)];
    fan.live[lane] = lane < vertices.size() ? -1 : 0;
  }
  fan.at = gather(moves.positions, fan.vertices);
  fan.size = gather_ring(moves.rings, moves.positions, fan.vertices, fan.at, fan.spokes.data(),
                         &fan.count);
  Lanes3 sum = {};
  Lanes lengths = {};
  for (std::size_t i = 0; i < fan.size; ++i) {
    sum = sum + cross(fan.spokes[i], fan.next(i));
    const Lanes length = root(dot(fan.spokes[i], fan.spokes[i]));
    lengths += fan.count > static_cast<float>(i) ? length : splat(0);
  }
  fan.normal = unit(sum);
  fan.mean_length = lengths / fan.count;
}

// The places where points come down on the extracted surface.
struct Landing {
  Lanes3 at;  // as the fan's spokes
  Mask is_there;
  std::array<std::uint32_t, kLanes> home;
};

// The triangle of a ring that a way leads over.
struct Wedge {
  Mask is_found = {};
  Mask side = {};    // the number of its first corner in the ring
  Lanes first = {};  // shares of the way along the two sides from the ring's vertex
  Lanes second = {};
  Lanes3 down = {};  // where the way comes down on the triangle's plane
};

// The first triangle of the ring in whose angle `way` lies, seen along the fan's normal. A ring
// that is no graph over the tangent plane may have none.
HWY_INLINE Wedge find_wedge(const Fan& fan, std::span<const Lanes3> ring, const Lanes3& way) {
  Wedge wedge;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Lanes3& a = ring[i];
    const Lanes3& b = ring[i + 1 == ring.size() ? 0 : i + 1];
    const Lanes area = dot(fan.normal, cross(a, b));
    const Lanes along_a = dot(fan.normal, cross(way, b));
    const Lanes along_b = dot(fan.normal, cross(a, way));
    const Mask is_within = (area > 0) & (along_a >= 0) & (along_b >= 0) & ~wedge.is_found;
    const Lanes s = along_a / area;
    const Lanes t = along_b / area;
    wedge.first = is_within ? s : wedge.first;
    wedge.second = is_within ? t : wedge.second;
    wedge.down = choose(is_within, s * a + t * b, wedge.down);
    wedge.side = is_within ? splat_int(static_cast<int>(i)) : wedge.side;
    wedge.is_found |= is_within;
  }
  return wedge;
}

// The next vertex of a lane's walk from `home`: the nearer corner of the wedge, or if there is none
// the neighbour that is nearest to where the way leads. `home` if no neighbour is nearer.
inline std::uint32_t next_home(std::span<const std::uint32_t> around, std::uint32_t home,
                               std::span<const Lanes3> ring, const Wedge& wedge, const Lanes3& way,
                               std::size_t lane) {
  if (wedge.is_found[lane] != 0) {
    const std::size_t side = static_cast<std::size_t>(wedge.side[lane]) % around.size();
    return around[wedge.first[lane] > wedge.second[lane] ? side : (side + 1) % around.size()];
  }
  const auto square = [](float x, float y, float z) { return x * x + y * y + z * z; };
  std::uint32_t next = home;
  float nearest = square(way.x[lane], way.y[lane], way.z[lane]);
  for (std::size_t i = 0; i < around.size(); ++i) {
    const float distance = square(way.x[lane] - ring[i].x[lane], way.y[lane] - ring[i].y[lane],
                                  way.z[lane] - ring[i].z[lane]);
    if (distance < nearest) next = around[i];
    nearest = std::min(nearest, distance);
  }
  return next;
}

// Rounds a landing to the precision in which it will be stored. Rejects landings that are too far
// from where the vertex was extracted.
HWY_INLINE void finish(const FanMoves& moves, const Fan& fan, const Lanes3& target,
                       Landing& landing) {
  // A move in the tangent plane keeps the enclosed volume, and coming down would not.
  const Lanes3 above = target - landing.at;
  const Lanes near = kNearSurface * fan.mean_length;
  landing.at = choose(dot(above, above) <= near * near, target, landing.at);
  landing.at = (fan.at + landing.at) - fan.at;
  const Lanes3 moved = landing.at + fan.at - gather(moves.extracted, fan.vertices);
  landing.is_there &= dot(moved, moved) <= splat(moves.max_displacement * moves.max_displacement);
}

// Walks on the extracted surface towards `target`, from ring to ring, and comes down along the
// fan's normal. A walk that reaches the boundary, or takes too long, ends within the last ring.
HWY_INLINE Landing land(const FanMoves& moves, const Fan& fan, const Lanes3& target) {
  Landing landing = {.at = {}, .is_there = {}, .home = {}};
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    landing.home[lane] = moves.home[fan.vertices[lane]];
  }
  Mask open = fan.live;
  std::array<Lanes3, Rings::kMostNeighbors> ring_room;
  for (int walk = 0; walk < kMostWalks && any(open); ++walk) {
    const Lanes3 home = gather(moves.extracted, landing.home) - fan.at;
    const std::size_t size = gather_ring(moves.rings, moves.extracted, landing.home, home + fan.at,
                                         ring_room.data(), nullptr);
    const auto ring = std::span<const Lanes3>(ring_room).first(size);
    const Lanes3 way = target - home;
    const Wedge wedge = find_wedge(fan, ring, way);
    const Lanes length = wedge.first + wedge.second;
    const bool is_last = walk + 1 == kMostWalks;
    Mask ends = open & wedge.is_found & (length <= 1);
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      if (open[lane] == 0 || ends[lane] != 0) continue;
      const std::uint32_t from = landing.home[lane];
      const std::uint32_t next = next_home(moves.rings.around(from), from, ring, wedge, way, lane);
      if (!is_last && next != from && moves.rings.has_ring(next)) {
        landing.home[lane] = next;
      } else if (wedge.is_found[lane] != 0) {
        ends[lane] = -1;
      } else {
        open[lane] = 0;
      }
    }
    constexpr float kWithin = 0.9F;
    const Lanes shorter = length > 1 ? kWithin / length : splat(1);
    landing.at = choose(ends, home + shorter * wedge.down, landing.at);
    landing.is_there |= ends;
    open &= ~ends;
  }
  finish(moves, fan, target, landing);
  return landing;
}

HWY_INLINE Lanes3 tangential(const Fan& fan, const Lanes3& way) {
  return way - dot(way, fan.normal) * fan.normal;
}

HWY_INLINE Lanes3 towards_mean(const Fan& fan) {
  Lanes3 sum = {};
  for (std::size_t i = 0; i < fan.size; ++i) {
    sum = sum + choose(fan.count > static_cast<float>(i), fan.spokes[i], Lanes3{});
  }
  return tangential(fan, (1 / fan.count) * sum);
}

// Each neighbour wants the vertex on the bisector of its own angle, as far away as it is.
HWY_INLINE Lanes3 towards_bisectors(const Fan& fan) {
  std::array<Lanes3, Rings::kMostNeighbors> sides;  // from a neighbour to the next one
  for (std::size_t i = 0; i < fan.size; ++i) sides[i] = unit(fan.next(i) - fan.spokes[i]);
  const auto is_side = [](const Lanes3& side) { return dot(side, side) > 0.5F; };
  Lanes3 before = {};
  for (std::size_t i = 0; i < fan.size; ++i) {  // the last side of each lane
    before = choose(is_side(sides[i]), sides[i], before);
  }
  constexpr float kFlattest = 1.05F;  // weighs a straight angle about half, a narrow one twenty
  Lanes3 sum = {};
  Lanes weights = {};
  for (std::size_t i = 0; i < fan.size; ++i) {
    const Mask is_real = is_side(sides[i]);
    const Lanes3 bisector = unit(cross(fan.normal, sides[i] + before));
    const Lanes weight = is_real ? 1 / (kFlattest + dot(sides[i], before)) : splat(0);
    const Lanes length = root(dot(fan.spokes[i], fan.spokes[i]));
    sum = sum + weight * (fan.spokes[i] + length * bisector);
    weights += weight;
    before = choose(is_real, sides[i], before);
  }
  return tangential(fan, (1 / (weights + kTiny)) * sum);
}

// The cosine of the smallest angle around the vertex if it were at `at`; 2 if a triangle has turned
// over.
HWY_INLINE Lanes smallest_angle(const Fan& fan, const Lanes3& at) {
  Lanes worst = splat(-1);
  Lanes3 from = fan.spokes[0] - at;
  const Lanes3 first = unit(from);
  Lanes3 ray = first;
  for (std::size_t i = 0; i < fan.size; ++i) {
    const Lanes3 to = fan.next(i) - at;
    const Lanes3 side = to - from;
    const Lanes square = dot(side, side);
    const Lanes3 across = unit(side);
    const Lanes3 next_ray = i + 1 < fan.size ? unit(to) : first;
    Lanes cosine = larger(dot(ray, next_ray), larger(-dot(ray, across), dot(next_ray, across)));
    cosine = dot(cross(from, to), fan.normal) > 0 ? cosine : splat(2);
    worst = square > 0 ? larger(worst, cosine) : worst;
    ray = next_ray;
    from = to;
  }
  return worst;
}

// Along the gradients of the angles that are nearly as small as the smallest.
HWY_INLINE Lanes3 uphill(const Fan& fan, const Lanes& worst) {
  constexpr float kNearly = 8;  // weights fall to 0 where the cosine is an eighth less
  Lanes3 sum = {};
  for (std::size_t i = 0; i < fan.size; ++i) {
    const Lanes3& a = fan.spokes[i];
    const Lanes3& b = fan.next(i);
    const Lanes3 c = b - a;
    const Mask is_real = dot(c, c) > 0;
    const Lanes over_a = 1 / (root(dot(a, a)) + kTiny);
    const Lanes over_b = 1 / (root(dot(b, b)) + kTiny);
    const Lanes3 to_a = over_a * a;
    const Lanes3 to_b = over_b * b;
    const Lanes3 across = unit(c);
    const auto weight = [&](const Lanes& cosine) {
      const Lanes share = larger(1 - kNearly * (worst - cosine), splat(0));
      return is_real ? share * share : splat(0);
    };
    const Lanes at_vertex = weight(dot(to_a, to_b));
    const Lanes at_a = weight(-dot(to_a, across));
    const Lanes at_b = weight(dot(to_b, across));
    const Lanes3 turn_a = over_a * cross(fan.normal, to_a);
    const Lanes3 turn_b = over_b * cross(fan.normal, to_b);
    sum = sum + at_vertex * (turn_a - turn_b) - at_a * turn_a + at_b * turn_b;
  }
  return fan.mean_length * unit(sum);
}

// How far `point` is, along the fan's normal, from the triangles of the fan around `apex`; far away
// if none is below or above it.
HWY_INLINE Lanes square_from_fan(const Fan& fan, const Lanes3& apex, const Lanes3& point) {
  const Lanes3 way = point - apex;
  Lanes result = splat(kFar);
  Lanes3 a = fan.spokes[0] - apex;
  for (std::size_t i = 0; i < fan.size; ++i) {
    const Lanes3 b = fan.next(i) - apex;
    const Lanes area = dot(fan.normal, cross(a, b));
    const Lanes along_a = dot(fan.normal, cross(way, b));
    const Lanes along_b = dot(fan.normal, cross(a, way));
    const Mask is_within = (area > 0) & (along_a >= 0) & (along_b >= 0);
    const Lanes3 off = way - (along_a / area) * a - (along_b / area) * b;
    const Lanes square = dot(off, off);
    result = (is_within & (square < result)) ? square : result;
    a = b;
  }
  return result;
}

// True for a move that turns over no more triangles, leaves each an area, and keeps the old place
// near the new triangles and the new place near the old ones.
HWY_INLINE Mask keeps_shape(const Fan& fan, const Lanes3& at) {
  Mask bad = {};
  for (std::size_t i = 0; i < fan.size; ++i) {
    const Lanes3& a = fan.spokes[i];
    const Lanes3& b = fan.next(i);
    const Lanes3 side = b - a;
    const Lanes3 area = cross(a - at, b - at);
    const Mask is_upright = dot(cross(a, b), fan.normal) > 0;
    const Mask is_real = dot(side, side) > 0;
    const Mask turns = (dot(area, fan.normal) <= 0) & is_upright;
    bad |= is_real & (turns | (dot(area, area) <= 0));
  }
  const Lanes most = kMostOff * fan.mean_length;
  bad |= square_from_fan(fan, at, Lanes3{}) > most * most;
  bad |= square_from_fan(fan, Lanes3{}, at) > most * most;
  return ~bad;
}

HWY_INLINE void store(const FanMoves& moves, const Fan& fan, const Landing& landing,
                      const Mask& which) {
  const Lanes3 at = fan.at + landing.at;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    if (which[lane] == 0) continue;
    moves.positions[fan.vertices[lane]] = {at.x[lane], at.y[lane], at.z[lane]};
    moves.home[fan.vertices[lane]] = landing.home[lane];
  }
}

HWY_INLINE void slide(const FanMoves& moves, const Fan& fan, const Lanes3& way) {
  const Landing landing = land(moves, fan, way);
  store(moves, fan, landing, landing.is_there & keeps_shape(fan, landing.at));
}

void optimize(const FanMoves& moves, Fan& fan) {
  const Lanes worst = smallest_angle(fan, Lanes3{});
  Mask open = fan.live & (worst > kCosOfSmall);
  if (!any(open)) return;
  constexpr float kClimb = 0.4F;  // of the mean length of the edges
  const std::array ways = {towards_mean(fan), towards_bisectors(fan), kClimb * uphill(fan, worst)};
  for (const float scale : {1.0F, 0.5F, 0.25F}) {
    Lanes3 best = {};
    Lanes least = splat(3);
    for (std::size_t i = 0; i < ways.size(); ++i) {
      const Lanes3 at = (i == 2 ? scale * scale : scale) * ways[i];
      const Lanes angle = smallest_angle(fan, at);
      best = choose(angle < least, at, best);
      least = angle < least ? angle : least;
    }
    const Mask before = fan.live;
    fan.live = open & (least < worst - kLeastGain);
    const Landing landing = land(moves, fan, best);
    const Mask better = fan.live & landing.is_there & keeps_shape(fan, landing.at) &
                        (smallest_angle(fan, landing.at) < worst - kLeastGain);
    fan.live = before;
    store(moves, fan, landing, better);
    open &= ~better;
    if (!any(open)) return;
  }
}

void move_fans_at_once(const FanMoves& moves, Move move, std::span<const std::uint32_t> vertices) {
  Fan fan;
  if (move != Move::kLargestAngle) {
    for (std::size_t begin = 0; begin < vertices.size(); begin += kLanes) {
      gather_fan(moves, vertices.subspan(begin, std::min(kLanes, vertices.size() - begin)), fan);
      slide(moves, fan, move == Move::kTangentialMean ? towards_mean(fan) : towards_bisectors(fan));
    }
    return;
  }
  std::array<std::uint32_t, 2 * kLanes> waiting;  // fans with a small angle
  std::size_t count = 0;
  const auto optimize_first = [&] {
    const std::size_t now = std::min(kLanes, count);
    gather_fan(moves, std::span(waiting).first(now), fan);
    optimize(moves, fan);
    std::copy(waiting.begin() + now, waiting.begin() + count, waiting.begin());
    count -= now;
  };
  for (std::size_t begin = 0; begin < vertices.size(); begin += kLanes) {
    gather_fan(moves, vertices.subspan(begin, std::min(kLanes, vertices.size() - begin)), fan);
    const Mask small = fan.live & (smallest_angle(fan, Lanes3{}) > kCosOfSmall);
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      if (small[lane] != 0) waiting[count++] = fan.vertices[lane];
    }
    if (count >= kLanes) optimize_first();
  }
  if (count > 0) optimize_first();
}

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace isomesh::mesh {

HWY_EXPORT(move_fans_at_once);

void move_fans(const FanMoves& moves, Move move, std::span<const std::uint32_t> vertices) {
  HWY_DYNAMIC_DISPATCH(move_fans_at_once)(moves, move, vertices);
}

}  // namespace isomesh::mesh
#endif
