// Marching tetrahedra, a layer of cells after the other.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "client/verify/field.h"

namespace isomesh::verify {
namespace {

constexpr std::uint32_t kNoVertex = UINT32_MAX;

// Corners of a cell are 0..7; their bits are the offsets along x, y and z.
using Tetrahedron = std::array<unsigned, 4>;

std::vector<Tetrahedron> split(int tetrahedra, bool is_odd) {
  // Along the diagonal 0-7: one for each order of the axes.
  if (tetrahedra == 6) {
    return {{0, 1, 3, 7}, {0, 1, 5, 7}, {0, 2, 3, 7}, {0, 2, 6, 7}, {0, 4, 5, 7}, {0, 4, 6, 7}};
  }
  if (is_odd) return {{1, 2, 4, 7}, {0, 1, 2, 4}, {3, 1, 2, 7}, {5, 1, 4, 7}, {6, 2, 4, 7}};
  return {{0, 3, 5, 6}, {1, 0, 3, 5}, {2, 0, 3, 6}, {4, 0, 5, 6}, {7, 3, 5, 6}};
}

class March {
 public:
  March(const Field& field, const Cut& cut) : field_(field), cut_(cut) {}

  Surface run() {
    // The layer around a closed surface has the index -1.
    const std::int64_t parity = cut_.close ? 1 : 0;
    const std::array splits = {split(cut_.tetrahedra, false), split(cut_.tetrahedra, true)};
    const auto& [nx, ny, nz] = field_.dims;
    forget(0);
    auto& [i, j, k] = cell_;
    for (k = 0; k + 1 < nz; ++k) {
      forget(k + 1);
      for (j = 0; j + 1 < ny; ++j) {
        for (i = 0; i + 1 < nx; ++i) {
          unsigned inside = 0;
          for (unsigned c = 0; c < 8; ++c) inside |= value(c) >= 0 ? 1U << c : 0;
          if (inside == 0 || inside == 255) continue;
          for (const Tetrahedron& t : splits.at((i + j + k + parity) & 1)) cut(t, inside);
        }
      }
    }
    put_in_order();
    return std::move(surface_);
  }

 private:
  // The points on the edges of plane k, which the samples at their lower ends own.
  std::vector<std::array<std::uint32_t, 8>>& points(std::int64_t k) { return points_[k & 1]; }
  void forget(std::int64_t k) {
    points(k).assign(
        static_cast<std::size_t>(field_.dims[0] * field_.dims[1]),
        {kNoVertex, kNoVertex, kNoVertex, kNoVertex, kNoVertex, kNoVertex, kNoVertex, kNoVertex});
  }

  std::size_t in_plane(unsigned c) const {
    return static_cast<std::size_t>((cell_[1] + (c >> 1 & 1)) * field_.dims[0] + cell_[0] +
                                    (c & 1));
  }
  double value(unsigned c) const {
    const auto plane = static_cast<std::size_t>(field_.dims[0] * field_.dims[1]);
    const auto k = static_cast<std::size_t>(cell_[2] + (c >> 2));
    const double f = field_.values[k * plane + in_plane(c)] - cut_.iso;
    return !cut_.midpoint || std::isinf(f) ? f : f >= 0 ? 1 : -1;
  }
  Vec place(unsigned c) const {
    const auto& [i, j, k] = cell_;
    return field_.place({static_cast<double>(i + (c & 1)), static_cast<double>(j + (c >> 1 & 1)),
                         static_cast<double>(k + (c >> 2))});
  }

  // The point where F is zero between an inside and an outside corner.
  std::uint32_t crossing(unsigned inside, unsigned outside) {
    const unsigned owner = inside & outside;
    std::uint32_t& number = points(cell_[2] + (owner >> 2))[in_plane(owner)][inside ^ outside];
    if (number == kNoVertex) {
      number = static_cast<std::uint32_t>(surface_.points.size());
      const auto& [nx, ny, nz] = field_.dims;
      const std::size_t plane = static_cast<std::size_t>(nx * ny);
      names_.push_back(
          8 * (static_cast<std::size_t>(cell_[2] + (owner >> 2)) * plane + in_plane(owner)) +
          (inside ^ outside));
      const double share = value(inside) / (value(inside) - value(outside));
      surface_.points.push_back(place(inside) + share * (place(outside) - place(inside)));
    }
    return number;
  }

  void cut(const Tetrahedron& corners, unsigned inside) {
    std::vector<unsigned> in;
    std::vector<unsigned> out;
    for (const unsigned c : corners) ((inside >> c & 1) != 0 ? in : out).push_back(c);
    if (in.empty() || out.empty()) return;
    // A triangle can lie in a face of the tetrahedron if its points are at corners, as on a cap:
    // then only some of the corners are beside it.
    Vec outwards = {0, 0, 0};
    for (const unsigned inner : in) {
      for (const unsigned outer : out) outwards = outwards + (place(outer) - place(inner));
    }
    Indices first = {crossing(in[0], out[0]), 0, 0};
    if (in.size() == 2) {
      first = {first[0], crossing(in[0], out[1]), crossing(in[1], out[1])};
      add({first[0], first[2], crossing(in[1], out[0])}, outwards);
    } else {
      for (std::size_t n = 1; n < 3; ++n) {
        first[n] = in.size() == 1 ? crossing(in[0], out[n]) : crossing(in[n], out[0]);
      }
    }
    add(first, outwards);
  }

  void add(const Indices& triangle, const Vec& outwards) {
    surface_.triangles.push_back(triangle);
    const Vec normal = normal_of(surface_.corners(surface_.triangles.size() - 1));
    if (dot(normal, outwards) >= 0) return;
    std::swap(surface_.triangles.back()[1], surface_.triangles.back()[2]);
  }

  void put_in_order() {
    std::vector<std::uint32_t> order(names_.size());
    std::iota(order.begin(), order.end(), 0U);
    std::ranges::sort(order, {}, [&](std::uint32_t point) { return names_[point]; });
    std::vector<std::uint32_t> numbers(order.size());
    std::vector<Vec> points;
    points.reserve(order.size());
    for (const std::uint32_t point : order) {
      numbers[point] = static_cast<std::uint32_t>(points.size());
      points.push_back(surface_.points[point]);
    }
    surface_.points = std::move(points);
    for (Indices& triangle : surface_.triangles) {
      for (std::uint32_t& corner : triangle) corner = numbers[corner];
    }
  }

  const Field& field_;
  const Cut cut_;
  Sample cell_ = {0, 0, 0};
  std::array<std::vector<std::array<std::uint32_t, 8>>, 2> points_;
  std::vector<std::size_t> names_;  // of the points: the edge's owner, and its direction there
  Surface surface_;
};

}  // namespace

// Samples at the iso-value get less than its negative: they are not below it, so they are outside.
void turn_over(Cut& cut, Field& field) {
  const double outside = std::nextafter(-cut.iso, -std::numeric_limits<double>::infinity());
  for (double& value : field.values) value = value < cut.iso ? -value : std::min(-value, outside);
  cut.iso = -cut.iso;
}

Surface zero_set(const Field& field, const Cut& cut) {
  if (!cut.close) return March(field, cut).run();
  const auto& [x, y, z] = field.dims;
  return March(field.part({-1, -1, -1}, {x + 1, y + 1, z + 1}), cut).run();
}

}  // namespace isomesh::verify
