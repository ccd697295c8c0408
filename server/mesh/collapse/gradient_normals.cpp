#include "server/mesh/collapse/gradient_normals.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "proto/samples.h"
#include "server/mesh/measure/normals.h"
#include "server/mesh/parallel.h"
#include "server/mesh/points.h"

namespace isomesh::mesh {
namespace {

constexpr double kLeastAgreement = 0.25;  // a cosine

template <class T>
class Gradient {
 public:
  explicit Gradient(const Lattice<T>& lattice)
      : lattice_(lattice), scale_(lattice.to_space.determinant()) {}

  // The direction in which samples grow. Its length depends on the place: the samples around are
  // taken times a power of two, because the square of their slope may overflow or underflow.
  Point at(const Vec3& place) const {
    const auto& [a, b, c] =
        std::array{lattice_.to_space.step_x, lattice_.to_space.step_y, lattice_.to_space.step_z};
    const Point slope = slopes_at(index_of(lattice_.to_space, {place[0], place[1], place[2]}));
    Point sum = {0, 0, 0};
    const std::array<Point, 3> ways = {cross(b, c), cross(c, a), cross(a, b)};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (std::size_t i = 0; i < 3; ++i) sum[i] += ways[axis][i] * slope[axis] / scale_;
    }
    return sum;
  }

 private:
  using Sample = std::array<std::uint32_t, 3>;
  using Slopes = std::array<Point, 8>;

  // The change per sample along each axis, trilinear between the eight samples around; times a
  // power of two that makes the largest about 1.
  Point slopes_at(const Point& index) const {
    const std::array<std::uint32_t, 3> counts = {lattice_.dims.x, lattice_.dims.y, lattice_.dims.z};
    Sample first;
    Point share;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double within = std::clamp(index[axis], 0.0, counts[axis] - 1.0);
      first[axis] = std::min(static_cast<std::uint32_t>(within), counts[axis] - 2);
      share[axis] = within - first[axis];
    }
    Slopes slopes = slopes_from(first, 1);
    double largest = largest_of(slopes);
    // The difference of two doubles can overflow; that of their halves cannot.
    if (std::isinf(largest)) {
      slopes = slopes_from(first, 0.5);
      largest = largest_of(slopes);
    }
    Point sum = {0, 0, 0};
    if (largest == 0) return sum;
    constexpr int kMostExponent = std::numeric_limits<double>::max_exponent - 1;
    const double unit = std::ldexp(1, std::min(-std::ilogb(largest), kMostExponent));
    for (unsigned corner = 0; corner < 8; ++corner) {
      double weight = 1;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        weight *= (corner >> axis & 1) != 0 ? share[axis] : 1 - share[axis];
      }
      for (std::size_t axis = 0; axis < 3; ++axis) {
        sum[axis] += weight * (slopes[corner][axis] * unit);
      }
    }
    return sum;
  }

  // Those of the eight samples around, if all were `times` as large.
  Slopes slopes_from(const Sample& first, double times) const {
    Slopes slopes;
    for (unsigned corner = 0; corner < 8; ++corner) {
      const Sample sample = {first[0] + (corner & 1), first[1] + (corner >> 1 & 1),
                             first[2] + (corner >> 2)};
      slopes[corner] = {slope_of(sample, 0, lattice_.dims.x, times),
                        slope_of(sample, 1, lattice_.dims.y, times),
                        slope_of(sample, 2, lattice_.dims.z, times)};
    }
    return slopes;
  }

  static double largest_of(const Slopes& slopes) {
    double largest = 0;
    for (const Point& slope : slopes) {
      for (const double along : slope) largest = std::max(largest, std::abs(along));
    }
    return largest;
  }

  // A central difference; at the border of the volume one to the sample inside.
  double slope_of(Sample sample, std::size_t axis, std::uint32_t count, double times) const {
    Sample before = sample;
    if (sample[axis] > 0) --before[axis];
    if (sample[axis] + 1 < count) ++sample[axis];
    return (value(sample) * times - value(before) * times) / (sample[axis] - before[axis]);
  }

  double value(const Sample& sample) const {
    const std::size_t row = std::size_t{sample[2]} * lattice_.dims.y + sample[1];
    return static_cast<double>(lattice_.samples[row * lattice_.dims.x + sample[0]]);
  }

  const Lattice<T>& lattice_;
  const double scale_;
};

}  // namespace

template <class T>
void set_gradient_normals(const Lattice<T>& lattice, Inside inside, const Context& context,
                          Mesh& mesh) {
  mesh.normals.clear();
  if (!lattice.dims.has_cells()) return;
  Buffer<Vec3> of_triangles;
  vertex_normals(mesh, context, of_triangles);
  mesh.normals.assign(of_triangles.begin(), of_triangles.end());
  const Gradient<T> gradient(lattice);
  for_each(context, mesh.positions.size(), [&](std::size_t v) {
    if (mesh.is_on_border(v)) return;
    const Point slope = gradient.at(mesh.positions[v]);
    const double square = dot(slope, slope);
    if (!std::isnormal(square)) return;  // slopes cancel out
    const double length = inside == Inside::kAbove ? -std::sqrt(square) : std::sqrt(square);
    Vec3& normal = mesh.normals[v];
    const double agreement =
        (slope[0] * normal[0] + slope[1] * normal[1] + slope[2] * normal[2]) / length;
    if (!(agreement > kLeastAgreement)) return;
    for (std::size_t i = 0; i < 3; ++i) normal[i] = static_cast<float>(slope[i] / length);
  });
}

#define ISOMESH_INSTANTIATE(T, name, kType) \
  template void set_gradient_normals(const Lattice<T>&, Inside, const Context&, Mesh&);
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::mesh
