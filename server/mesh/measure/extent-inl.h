// Area, enclosed volume and bounds of a layer; private to the kernels. All measurements use it,
// layer by layer, so the same mesh always has the same figures.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>

#include "server/mesh/measure/measure.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// A position and one idle lane.
using Float4 = float __attribute__((vector_size(16)));

// Reads nothing of the next position, which another thread may be writing.
inline Float4 load(const Vec3& position) {
  return Float4{position[0], position[1], position[2], 0};
}

// One coordinate of two points.
using Double2 = double __attribute__((vector_size(16)));

struct TwoPoints {
  static TwoPoints of(Float4 first, Float4 second) {
    return {__builtin_convertvector(__builtin_shufflevector(first, second, 0, 4), Double2),
            __builtin_convertvector(__builtin_shufflevector(first, second, 1, 5), Double2),
            __builtin_convertvector(__builtin_shufflevector(first, second, 2, 6), Double2)};
  }

  TwoPoints operator-(const TwoPoints& other) const {
    return {x - other.x, y - other.y, z - other.z};
  }
  Double2 dot(const TwoPoints& other) const { return x * other.x + y * other.y + z * other.z; }
  TwoPoints cross(const TwoPoints& other) const {
    return {y * other.z - z * other.y, z * other.x - x * other.z, x * other.y - y * other.x};
  }

  Double2 x;
  Double2 y;
  Double2 z;
};

// True if a triangle with these two sides and this normal, their product, has an area that rounding
// may have made: an angle below 2^-48. Corners in single precision that are not in line have larger
// ones as a rule, while the product of sides that are need not come out as zero.
inline auto is_flat(const TwoPoints& side, const TwoPoints& other, const TwoPoints& normal) {
  return normal.dot(normal) <= 0x1p-96 * (side.dot(side) * other.dot(other));
}

class LayerExtent {
 public:
  // `corner` gives the position of a vertex as a Float4.
  template <class Corner>
  void add_triangles(std::span<const Triangle> triangles, const std::array<double, 3>& origin,
                     Corner corner) {
    const TwoPoints apex = {{origin[0], origin[0]}, {origin[1], origin[1]}, {origin[2], origin[2]}};
    Double2 areas = {};
    Double2 volumes = {};
    decltype(areas == 0) flat = {};
    const auto add_two = [&](const Triangle& first, const Triangle& second) {
      const auto at = TwoPoints::of(corner(first[0]), corner(second[0]));
      const TwoPoints side = TwoPoints::of(corner(first[1]), corner(second[1])) - at;
      const TwoPoints other = TwoPoints::of(corner(first[2]), corner(second[2])) - at;
      const TwoPoints normal = side.cross(other);
      const Double2 squares = normal.dot(normal);
      flat |= is_flat(side, other, normal);
      areas += Double2{std::sqrt(squares[0]), std::sqrt(squares[1])};
      volumes += (at - apex).dot(normal);
    };
    std::size_t t = 0;
    for (; t + 1 < triangles.size(); t += 2) add_two(triangles[t], triangles[t + 1]);
    if (t < triangles.size()) {
      const std::uint32_t any = triangles[t][0];
      const auto second = flat[1];
      add_two(triangles[t], {any, any, any});  // a filler without area
      flat[1] = second;
    }
    has_flat_ |= (flat[0] | flat[1]) != 0;
    area_ += (areas[0] + areas[1]) / 2;
    volume_ += (volumes[0] + volumes[1]) / 6;
  }

  void add_vertex(Float4 position) {
    low_ = position < low_ ? position : low_;
    high_ = position > high_ ? position : high_;
  }

  // True if a triangle has no area.
  bool has_flat() const { return has_flat_; }

  // Adds the sums of another layer. The caller adds layers in order.
  void add(const LayerExtent& other) {
    area_ += other.area_;
    volume_ += other.volume_;
    low_ = other.low_ < low_ ? other.low_ : low_;
    high_ = other.high_ > high_ ? other.high_ : high_;
  }

  Extent extent() const {
    if (low_[0] > high_[0]) return {};
    return {area_, volume_, {low_[0], low_[1], low_[2]}, {high_[0], high_[1], high_[2]}};
  }

 private:
  static constexpr float kInfinity = std::numeric_limits<float>::infinity();
  double area_ = 0;
  double volume_ = 0;
  bool has_flat_ = false;
  Float4 low_ = {kInfinity, kInfinity, kInfinity, kInfinity};
  Float4 high_ = {-kInfinity, -kInfinity, -kInfinity, -kInfinity};
};

// True for the triangles that make has_flat() true.
inline bool has_no_area(const Vec3& a, const Vec3& b, const Vec3& c) {
  const auto point = [](const Vec3& at) { return TwoPoints::of(load(at), load(at)); };
  const TwoPoints side = point(b) - point(a);
  const TwoPoints other = point(c) - point(a);
  return is_flat(side, other, side.cross(other))[0] != 0;
}

inline bool has_no_area(const Mesh& mesh, const Triangle& triangle) {
  const auto& [a, b, c] = triangle;
  return has_no_area(mesh.positions[a], mesh.positions[b], mesh.positions[c]);
}

inline void add_triangles(const Mesh& mesh, std::size_t layer, LayerExtent& extent) {
  extent.add_triangles(mesh.triangles_of(layer, layer + 1), mesh.origin,
                       [&](std::uint32_t vertex) { return load(mesh.positions[vertex]); });
}

}  // namespace isomesh::mesh
