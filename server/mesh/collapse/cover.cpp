#include "server/mesh/collapse/cover.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>
#include <random>
#include <utility>

#include "server/mesh/parallel.h"

namespace isomesh::mesh::collapse {
namespace {

// Rays along each axis, first from the largest triangle of a component and then from the largest
// ones of several groups: all points of one may lie in a plane with edges of T- or all over T+, as
// in a cap of samples at the iso-value.
constexpr unsigned kGroups = 5;
constexpr unsigned kAttempts = 3 * (1 + kGroups);
constexpr double kTooNear = 1e-11;  // more than what rounding moves a place

// A ray from a point of a component along its first axis; behind the volume's last face it goes on
// along the second, and behind that face's last edge along the third. There S, T+ and T- are what
// they are in the face and at its edge. Places are in the order of these axes.
struct Ray {
  Vecd from;
  std::uint32_t component = 0;
  std::atomic<std::uint32_t> crossed = 0;
  std::atomic<bool> is_too_near = false;

  Ray(Vecd point, std::uint32_t of) : from(point), component(of) {}
  Ray(const Ray& other) : from(other.from), component(other.component) {}
  Ray& operator=(const Ray&) = delete;
  ~Ray() = default;

  // `unsure`: how far from there it may be, at most.
  void cross(double distance, double unsure = kTooNear) {
    if (!(std::abs(distance) >= unsure)) is_too_near = true;
    if (distance > 0) ++crossed;
  }
  bool is_odd() const { return !is_too_near && (crossed & 1) != 0; }
};

constexpr std::uint32_t kNone = ~std::uint32_t{0};

struct Start {
  Vecd from;
  std::uint32_t component = 0;
};

class Rays {
 public:
  // One ray for each start; no two starts are of one component. `axis`: the first one; the others
  // follow in cyclic order.
  Rays(const Field& field, const Surfaces& surfaces, unsigned axis, std::vector<Start> starts)
      : surfaces_(surfaces),
        axis_(axis),
        last_(turned({field.dims.x - 1.0, field.dims.y - 1.0, field.dims.z - 1.0})),
        columns_y_(static_cast<std::size_t>(last_.y) + 1),
        begin_(columns_y_ * (static_cast<std::size_t>(last_.z) + 1) + 1, 0),
        ray_of_(surfaces.components.count, kNone) {
    for (Start& start : starts) start.from = turned(start.from);
    std::ranges::sort(starts, {}, [&](const Start& start) { return column_of(start.from); });
    for (const Start& start : starts) {
      ++begin_[column_of(start.from) + 1];
      ray_of_[start.component] = static_cast<std::uint32_t>(rays_.size());
      rays_.emplace_back(start.from, start.component);
    }
    std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
  }

  // Counts the crossings of those that are of the triangle's component.
  void cross(const Triangle& triangle, Vecf Vertex::*side) {
    const std::array<Vecd, 3> p = {place(triangle[0], side), place(triangle[1], side),
                                   place(triangle[2], side)};
    const auto [low_y, high_y] = std::minmax({p[0].y, p[1].y, p[2].y});
    const auto [low_z, high_z] = std::minmax({p[0].z, p[1].z, p[2].z});
    const std::uint32_t own = component_of(triangle[0]);
    for (auto z = static_cast<std::size_t>(low_z); z <= static_cast<std::size_t>(high_z); ++z) {
      const std::size_t end = begin_[z * columns_y_ + static_cast<std::size_t>(high_y) + 1];
      for (std::size_t i = begin_[z * columns_y_ + static_cast<std::size_t>(low_y)]; i < end; ++i) {
        // A triangle without area, as around a sample at the iso-value, is told from the ray by
        // this.
        const Vecd from = rays_[i].from;
        const bool may_meet =
            low_y <= from.y && from.y <= high_y && low_z <= from.z && from.z <= high_z;
        if (may_meet && rays_[i].component == own) cross(p, rays_[i]);
      }
    }
  }

  // The same of what goes on behind the face of the largest x, and at its edge of the largest y.
  void cross_behind(std::span<const Edge> edges, Vecf Vertex::*side) {
    for (const auto& [a, b] : edges) {
      const std::uint32_t index = ray_of_[component_of(a)];
      if (index == kNone || !is_behind(a) || !is_behind(b)) continue;
      Ray& ray = rays_[index];
      cross_edge(place(a, side), place(b, side), ray);
      for (const std::uint32_t v : {a, b}) {
        if (place(v, &Vertex::p).y == last_.y) ray.cross(place(v, side).z - ray.from.z);
      }
    }
  }

  std::span<const Ray> rays() const { return rays_; }
  std::uint32_t component_of(std::uint32_t vertex) const { return surfaces_.component_of(vertex); }

 private:
  std::size_t column_of(Vecd p) const {
    return static_cast<std::size_t>(p.z) * columns_y_ + static_cast<std::size_t>(p.y);
  }
  bool is_behind(std::uint32_t v) const { return place(v, &Vertex::p).x == last_.x; }
  Vecd turned(Vecd p) const {
    return axis_ == 0 ? p : axis_ == 1 ? Vecd{p.y, p.z, p.x} : Vecd{p.z, p.x, p.y};
  }
  Vecd place(std::uint32_t v, Vecf Vertex::*side) const {
    return turned(wide(surfaces_.vertices[v].*side));
  }

  static void cross(const std::array<Vecd, 3>& p, Ray& ray) {
    std::array<Vecd, 3> at;
    double reach = 0;  // of the triangle, from the ray
    for (std::size_t i = 0; i < 3; ++i) {
      at[i] = p[i] - ray.from;
      reach = std::max({reach, std::abs(at[i].y), std::abs(at[i].z)});
    }
    // The smaller the triangle, the better its areas are known: it may be around a sample whose
    // value is the iso-value.
    const double least_sure = kTooNear * reach;
    std::array<double, 3> area;
    for (std::size_t i = 0; i < 3; ++i) {
      const Vecd a = at[(i + 1) % 3];
      const Vecd b = at[(i + 2) % 3];
      area[i] = a.y * b.z - a.z * b.y;
    }
    const auto [least, most] = std::ranges::minmax(area);
    if (least < -least_sure && most > least_sure) return;
    for (const double each : area) {
      if (!(std::abs(each) >= least_sure)) {
        ray.is_too_near = true;
        return;
      }
    }
    const double whole = area[0] + area[1] + area[2];
    const auto [low_x, high_x] = std::minmax({at[0].x, at[1].x, at[2].x});
    ray.cross((area[0] * at[0].x + area[1] * at[1].x + area[2] * at[2].x) / whole,
              kTooNear + 3 * least_sure * (high_x - low_x) / std::abs(whole));
  }

  static void cross_edge(Vecd a, Vecd b, Ray& ray) {
    const double z = ray.from.z;
    if (std::abs(a.z - z) < kTooNear || std::abs(b.z - z) < kTooNear) ray.is_too_near = true;
    if ((a.z > z) == (b.z > z)) return;
    ray.cross(a.y + (z - a.z) / (b.z - a.z) * (b.y - a.y) - ray.from.y);
  }

  const Surfaces& surfaces_;
  const unsigned axis_;
  const Vecd last_;  // the volume's last sample
  const std::size_t columns_y_;
  std::vector<std::size_t> begin_;     // of each column's rays
  std::vector<std::uint32_t> ray_of_;  // of each component
  std::vector<Ray> rays_;
};

// How well a ray from the triangle of S can be told from T+ and T-: its area, in voxels, and how
// far it is from the samples, which T+ or T- may touch.
double room_of(const Field& field, const Surfaces& surfaces, const Triangle& triangle) {
  const auto crossing = [&](std::size_t i) { return surfaces.crossings[triangle[i]]; };
  double off_samples = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const double inside = field.values[crossing(i).inside];
    const double outside = -field.values[crossing(i).outside];
    off_samples = std::max(off_samples, std::min(inside, outside) / (inside + outside));
  }
  const Vecd a = zero_between(field, crossing(0));
  return off_samples *
         length(cross(zero_between(field, crossing(1)) - a, zero_between(field, crossing(2)) - a));
}

// A triangle of each of the components of S in `left`: the first with much room, or the one with
// most. Around samples at the iso-value there is little. `group`: 0 for all triangles, or one of
// kGroups parts of them.
std::vector<std::uint32_t> starts_of(const Field& field, const Surfaces& surfaces,
                                     std::span<const std::uint32_t> left, unsigned group) {
  constexpr double kMuch = 0.005;
  std::vector<double> most(surfaces.components.count, kMuch);
  for (const std::uint32_t component : left) most[component] = -1;
  std::vector<std::uint32_t> starts(surfaces.components.count, kNone);
  for (std::uint32_t t = 0; t < surfaces.extracted.size(); ++t) {
    const std::uint32_t component = surfaces.components.of_vertex[surfaces.extracted[t][0]];
    if (most[component] >= kMuch) continue;
    if (group > 0 && t % kGroups != group - 1) continue;
    const double room = room_of(field, surfaces, surfaces.extracted[t]);
    if (!(room > most[component])) continue;
    most[component] = room;
    starts[component] = t;
  }
  return starts;
}

// A random point of the triangle of each of the components, which moves to `none` if it has none.
std::vector<Start> cast(const Field& field, const Surfaces& surfaces,
                        std::span<const std::uint32_t> triangles,
                        std::span<const std::uint32_t> left, std::mt19937& random,
                        std::vector<std::uint32_t>& none) {
  const auto share = [&] { return 0.1 + static_cast<double>(random() >> 8) / (1 << 24); };
  std::vector<Start> starts;
  for (const std::uint32_t component : left) {
    if (triangles[component] == kNone) {
      none.push_back(component);
      continue;
    }
    Vecd sum;
    double weight = 0;
    for (const std::uint32_t v : surfaces.extracted[triangles[component]]) {
      const double part = share();
      sum = sum + zero_between(field, surfaces.crossings[v]) * part;
      weight += part;
    }
    starts.push_back({sum * (1 / weight), component});
  }
  return starts;
}

}  // namespace

std::vector<std::uint32_t> uncovered(const Field& field, const Surfaces& surfaces,
                                     std::span<const Edge> border, const Context& context) {
  std::vector<std::uint32_t> left(surfaces.components.count);
  std::iota(left.begin(), left.end(), 0U);
  std::mt19937 random(1);
  for (unsigned attempt = 0; attempt < kAttempts && !left.empty(); ++attempt) {
    const std::vector<std::uint32_t> triangles = starts_of(field, surfaces, left, attempt / 3);
    std::vector<std::uint32_t> still_left;
    Rays rays(field, surfaces, attempt % 3,
              cast(field, surfaces, triangles, left, random, still_left));
    if (attempt < 3) still_left.clear();  // without any triangle: nothing is there to be covered
    for_each(context, surfaces.triangles.size(), [&](std::size_t t) {
      rays.cross(surfaces.triangles[t], &Vertex::in);
      rays.cross(surfaces.triangles[t], &Vertex::out);
    });
    rays.cross_behind(border, &Vertex::in);
    rays.cross_behind(border, &Vertex::out);
    for (const Ray& ray : rays.rays()) {
      if (!ray.is_odd()) still_left.push_back(ray.component);
    }
    std::ranges::sort(still_left);
    left = std::move(still_left);
  }
  return left;
}

}  // namespace isomesh::mesh::collapse
