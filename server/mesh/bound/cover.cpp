#include "server/mesh/bound/cover.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>
#include <random>

#include "server/mesh/bound/chunks.h"

namespace isomesh::mesh::bound {
namespace {

constexpr int kAttempts = 5;
constexpr double kTooNear = 1e-11;

// A ray from a point of a component along x; behind the volume's last face it goes on along y, and
// behind that face's last edge along z. There S, T+ and T- are what they are in the face and at
// its edge.
struct Ray {
  Vecd from;
  std::uint32_t component = 0;
  std::atomic<std::uint32_t> crossed = 0;
  std::atomic<bool> is_too_near = false;

  Ray(Vecd point, std::uint32_t of) : from(point), component(of) {}
  Ray(const Ray& other) : from(other.from), component(other.component) {}
  Ray& operator=(const Ray&) = delete;
  ~Ray() = default;

  void cross(double distance) {
    if (std::abs(distance) < kTooNear) is_too_near = true;
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
  Rays(const Field& field, const Surfaces& surfaces)
      : surfaces_(surfaces),
        columns_y_(field.dims.y),
        begin_(std::size_t{field.dims.y} * field.dims.z + 1, 0),
        ray_of_(surfaces.components.count, kNone),
        last_x_(static_cast<float>(field.dims.x - 1)),
        last_y_(static_cast<float>(field.dims.y - 1)) {}

  void set(std::vector<Start> starts) {
    std::ranges::fill(begin_, 0);
    std::ranges::fill(ray_of_, kNone);
    rays_.clear();
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
        if (surfaces_.vertices[v].p.y == last_y_) ray.cross(place(v, side).z - ray.from.z);
      }
    }
  }

  std::span<const Ray> rays() const { return rays_; }
  std::uint32_t component_of(std::uint32_t vertex) const { return surfaces_.component_of(vertex); }

 private:
  std::size_t column_of(Vecd p) const {
    return static_cast<std::size_t>(p.z) * columns_y_ + static_cast<std::size_t>(p.y);
  }
  bool is_behind(std::uint32_t v) const { return surfaces_.vertices[v].p.x == last_x_; }
  Vecd place(std::uint32_t v, Vecf Vertex::*side) const {
    return wide(surfaces_.vertices[v].*side);
  }

  static void cross(const std::array<Vecd, 3>& p, Ray& ray) {
    std::array<double, 3> area;
    for (std::size_t i = 0; i < 3; ++i) {
      const Vecd a = p[(i + 1) % 3] - ray.from;
      const Vecd b = p[(i + 2) % 3] - ray.from;
      area[i] = a.y * b.z - a.z * b.y;
    }
    const auto [least, most] = std::ranges::minmax(area);
    if (least < -kTooNear && most > kTooNear) return;
    for (const double each : area) {
      if (std::abs(each) < kTooNear) {
        ray.is_too_near = true;
        return;
      }
    }
    ray.cross((area[0] * p[0].x + area[1] * p[1].x + area[2] * p[2].x) /
                  (area[0] + area[1] + area[2]) -
              ray.from.x);
  }

  static void cross_edge(Vecd a, Vecd b, Ray& ray) {
    const double z = ray.from.z;
    if (std::abs(a.z - z) < kTooNear || std::abs(b.z - z) < kTooNear) ray.is_too_near = true;
    if ((a.z > z) == (b.z > z)) return;
    ray.cross(a.y + (z - a.z) / (b.z - a.z) * (b.y - a.y) - ray.from.y);
  }

  const Surfaces& surfaces_;
  const std::size_t columns_y_;
  std::vector<std::size_t> begin_;     // of each column's rays
  std::vector<std::uint32_t> ray_of_;  // of each component
  std::vector<Ray> rays_;
  const float last_x_;
  const float last_y_;
};

// Twice the area of a triangle of S, in voxels.
double area_of(const Field& field, const Surfaces& surfaces, const Triangle& triangle) {
  const auto place = [&](std::size_t i) {
    return zero_between(field, surfaces.crossings[triangle[i]]);
  };
  const Vecd a = place(0);
  return length(cross(place(1) - a, place(2) - a));
}

// A triangle of each component of S: the first large one, or the largest. Around a sample at the
// iso-value others are too small to tell a ray from an edge.
std::vector<std::uint32_t> starts_of(const Field& field, const Surfaces& surfaces) {
  constexpr double kLarge = 0.02;
  std::vector<double> largest(surfaces.components.count, -1);
  std::vector<std::uint32_t> starts(surfaces.components.count, kNone);
  for (std::uint32_t t = 0; t < surfaces.extracted.size(); ++t) {
    const std::uint32_t component = surfaces.components.of_vertex[surfaces.extracted[t][0]];
    if (largest[component] > kLarge) continue;
    const double area = area_of(field, surfaces, surfaces.extracted[t]);
    if (!(area > largest[component])) continue;
    largest[component] = area;
    starts[component] = t;
  }
  return starts;
}

// A random point of the triangle of each of the components.
std::vector<Start> cast(const Field& field, const Surfaces& surfaces,
                        std::span<const std::uint32_t> triangles,
                        std::span<const std::uint32_t> left, std::mt19937& random) {
  const auto share = [&] { return 0.1 + static_cast<double>(random() >> 8) / (1 << 24); };
  std::vector<Start> starts;
  for (const std::uint32_t component : left) {
    if (triangles[component] == kNone) continue;  // nothing is there to be covered
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
  Rays rays(field, surfaces);
  const std::vector<std::uint32_t> triangles = starts_of(field, surfaces);
  std::mt19937 random(1);
  for (int attempt = 0; attempt < kAttempts && !left.empty(); ++attempt) {
    rays.set(cast(field, surfaces, triangles, left, random));
    for_each(context, surfaces.triangles.size(), [&](std::size_t t) {
      rays.cross(surfaces.triangles[t], &Vertex::in);
      rays.cross(surfaces.triangles[t], &Vertex::out);
    });
    rays.cross_behind(border, &Vertex::in);
    rays.cross_behind(border, &Vertex::out);
    left.clear();
    for (const Ray& ray : rays.rays()) {
      if (!ray.is_odd()) left.push_back(ray.component);
    }
    std::ranges::sort(left);
  }
  return left;
}

}  // namespace isomesh::mesh::bound
