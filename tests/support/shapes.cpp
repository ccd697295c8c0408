#include "tests/support/shapes.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <type_traits>

#include "proto/samples.h"

namespace isomesh::test {
namespace {

template <class T>
T to_sample(double value) {
  if constexpr (std::is_integral_v<T>) {
    const double low = std::numeric_limits<T>::lowest();
    const double high = std::numeric_limits<T>::max();
    return static_cast<T>(std::min(std::max(std::nearbyint(value), low), high));
  } else {
    return static_cast<T>(value);
  }
}

template <class T>
SampleVolume<T> empty_volume(const mesh::Dims& dims, const Geometry& geometry = {}) {
  return {std::vector<T>(dims.samples()), dims, geometry};
}

// Calls visit(sample, i, j, k) for every sample, x fastest.
template <class T, class Visit>
void for_each_sample(SampleVolume<T>& volume, const Visit& visit) {
  const mesh::Dims& dims = volume.dims;
  for (std::uint32_t k = 0; k < dims.z; ++k) {
    for (std::uint32_t j = 0; j < dims.y; ++j) {
      for (std::uint32_t i = 0; i < dims.x; ++i) visit(volume.at(i, j, k), i, j, k);
    }
  }
}

double dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Point cross(const Point& a, const Point& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// Row-major rotation by `angle` around a unit axis (Rodrigues).
std::array<double, 9> rotation(const Point& axis, double angle) {
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  const auto& [x, y, z] = axis;
  return {c + x * x * (1 - c),     x * y * (1 - c) - z * s, x * z * (1 - c) + y * s,
          y * x * (1 - c) + z * s, c + y * y * (1 - c),     y * z * (1 - c) - x * s,
          z * x * (1 - c) - y * s, z * y * (1 - c) + x * s, c + z * z * (1 - c)};
}

}  // namespace

mesh::LatticeToSpace space_of(const Geometry& geometry) {
  mesh::LatticeToSpace map;
  map.origin = geometry.origin;
  for (std::size_t row = 0; row < 3; ++row) {
    map.step_x[row] = geometry.direction[row * 3 + 0] * geometry.spacing[0];
    map.step_y[row] = geometry.direction[row * 3 + 1] * geometry.spacing[1];
    map.step_z[row] = geometry.direction[row * 3 + 2] * geometry.spacing[2];
  }
  return map;
}

Point to_space(const mesh::LatticeToSpace& map, const Point& lattice_point) {
  Point result = map.origin;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    result[axis] += map.step_x[axis] * lattice_point[0] + map.step_y[axis] * lattice_point[1] +
                    map.step_z[axis] * lattice_point[2];
  }
  return result;
}

Point to_lattice(const mesh::LatticeToSpace& map, const Point& space_point) {
  const Point p = {space_point[0] - map.origin[0], space_point[1] - map.origin[1],
                   space_point[2] - map.origin[2]};
  const double determinant = dot(map.step_x, cross(map.step_y, map.step_z));
  return {dot(p, cross(map.step_y, map.step_z)) / determinant,
          dot(p, cross(map.step_z, map.step_x)) / determinant,
          dot(p, cross(map.step_x, map.step_y)) / determinant};
}

Field sphere(const Point& centre, double radius) {
  return [=](const Point& p) {
    return radius - std::hypot(p[0] - centre[0], p[1] - centre[1], p[2] - centre[2]);
  };
}

Field torus(const Point& centre, double major_radius, double minor_radius) {
  return [=](const Point& p) {
    const double ring = std::hypot(p[0] - centre[0], p[1] - centre[1]) - major_radius;
    return minor_radius - std::hypot(ring, p[2] - centre[2]);
  };
}

Field plane(const Point& unit_normal, double offset) {
  return [=](const Point& p) { return offset - dot(unit_normal, p); };
}

Field gyroid(double period) {
  return [k = 2 * std::numbers::pi / period](const Point& p) {
    return std::sin(k * p[0]) * std::cos(k * p[1]) + std::sin(k * p[1]) * std::cos(k * p[2]) +
           std::sin(k * p[2]) * std::cos(k * p[0]);
  };
}

Field tangle_cube(double scale) {
  return [=](const Point& p) {
    double sum = -11.8;
    for (const double coordinate : p) {
      const double square = scale * scale * coordinate * coordinate;
      sum -= square * (square - 5);
    }
    return sum;
  };
}

Field scaled(const Field& field, double gain, double offset) {
  return [=](const Point& p) { return gain * field(p) + offset; };
}

template <class T>
SampleVolume<T> sample(const Field& field, const mesh::Dims& dims, const Geometry& geometry) {
  SampleVolume<T> volume = empty_volume<T>(dims, geometry);
  const mesh::LatticeToSpace map = space_of(geometry);
  for_each_sample(volume, [&](T& value, double i, double j, double k) {
    value = to_sample<T>(field(to_space(map, {i, j, k})));
  });
  return volume;
}

mesh::Dims unit_cube_dims(std::uint32_t n) { return {n, n, n}; }

Geometry unit_cube_geometry(std::uint32_t n) {
  const double spacing = 2.0 / (n - 1);
  return {{-1, -1, -1}, {spacing, spacing, spacing}, {1, 0, 0, 0, 1, 0, 0, 0, 1}};
}

template <class T>
SampleVolume<T> noise(const std::vector<T>& values, const mesh::Dims& dims, std::uint64_t seed,
                      const Geometry& geometry) {
  SampleVolume<T> volume = empty_volume<T>(dims, geometry);
  std::mt19937_64 engine(seed);
  for (T& value : volume.samples) value = values[engine() % values.size()];
  return volume;
}

template <class T>
SampleVolume<T> noise_between(double low, double high, const mesh::Dims& dims, std::uint64_t seed) {
  SampleVolume<T> volume = empty_volume<T>(dims);
  std::mt19937_64 engine(seed);
  for (T& value : volume.samples) {
    const double share = static_cast<double>(engine() >> 11) * 0x1p-53;
    value = to_sample<T>(low * (1 - share) + high * share);
  }
  return volume;
}

SampleVolume<float> thin_shell(std::uint32_t seed) {
  const mesh::Dims dims = {9, 8, 9};
  auto volume = noise_between<float>(-0.3, 0.3, dims, seed);
  for (std::uint32_t z = 0; z < dims.z; ++z) {
    for (std::uint32_t y = 0; y < dims.y; ++y) {
      for (std::uint32_t x = 0; x < dims.x; ++x) {
        const double way = std::hypot(x - 4.1, y - 3.9, z - 4.2) - 2.6;
        volume.at(x, y, z) += static_cast<float>(0.3 + 0.05 * seed - std::abs(way));
      }
    }
  }
  return volume;
}

template <class T>
SampleVolume<T> constant(T value, const mesh::Dims& dims) {
  return {std::vector<T>(dims.samples(), value), dims, {}};
}

template <class T>
SampleVolume<T> checkerboard(T even, T odd, const mesh::Dims& dims) {
  SampleVolume<T> volume = empty_volume<T>(dims);
  for_each_sample(volume, [&](T& value, std::uint32_t i, std::uint32_t j, std::uint32_t k) {
    value = (i + j + k) % 2 == 0 ? even : odd;
  });
  return volume;
}

template <class T>
void set_border(SampleVolume<T>& volume, T border) {
  const mesh::Dims dims = volume.dims;
  for_each_sample(volume, [&](T& value, std::uint32_t i, std::uint32_t j, std::uint32_t k) {
    if (i == 0 || j == 0 || k == 0 || i + 1 == dims.x || j + 1 == dims.y || k + 1 == dims.z) {
      value = border;
    }
  });
}

template <class T>
SampleVolume<T> sign_pattern(unsigned pattern, Parity parity, Surround surround) {
  constexpr std::uint32_t kCorners[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                            {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
  const double around = surround == Surround::kInside ? kPatternIso + 23 : kPatternIso - 17;
  const std::uint32_t x = parity == Parity::kOdd ? 1 : 2;
  SampleVolume<T> volume = constant<T>(to_sample<T>(around), {x + 3, 4, 4});
  for (unsigned c = 0; c < 8; ++c) {
    const bool inside = (pattern >> c & 1U) != 0;
    const double value = inside ? kPatternIso + 3 * c : kPatternIso - 1 - 5 * c;
    volume.at(x + kCorners[c][0], 1 + kCorners[c][1], 1 + kCorners[c][2]) = to_sample<T>(value);
  }
  return volume;
}

Geometry anisotropic_geometry() {
  return {{10, -20, 30}, {0.5, 0.75, 2.5}, {1, 0, 0, 0, 1, 0, 0, 0, 1}};
}

Geometry oblique_geometry() {
  const Point axis = {2.0 / 7, 3.0 / 7, 6.0 / 7};
  return {{-90, 126, -72}, {0.9, 1.1, 1.3}, rotation(axis, 0.7)};
}

Geometry left_handed_geometry() { return {{5, 6, 7}, {1, 1, 1}, {1, 0, 0, 0, -1, 0, 0, 0, 1}}; }

Geometry oblique_left_handed_geometry() {
  Geometry geometry = oblique_geometry();
  geometry.spacing = {0.6, 0.7, 3};
  for (std::size_t row = 0; row < 3; ++row) geometry.direction[row * 3 + 2] *= -1;
  return geometry;
}

Geometry far_geometry() {
  return {{-250, -180, -1200}, {0.5, 0.5, 0.625}, {1, 0, 0, 0, 1, 0, 0, 0, 1}};
}

Geometry oblique_far_geometry() {
  const Point axis = {6.0 / 7, -2.0 / 7, 3.0 / 7};
  return {{-250, 180, -1200}, {0.4, 0.4, 0.6}, rotation(axis, 0.3)};
}

Geometry tilted_geometry() {
  const double tilt = 20 * std::numbers::pi / 180;
  return {.origin = {-20, 35, -110},
          .spacing = {0.75, 0.75, 1.5},
          .direction = {1, 0, 0, 0, std::cos(tilt), 0, 0, -std::sin(tilt), 1}};
}

std::vector<NamedGeometry> all_geometries() {
  return {{"identity", {}},
          {"anisotropic", anisotropic_geometry()},
          {"oblique", oblique_geometry()},
          {"left_handed", left_handed_geometry()},
          {"oblique_left_handed", oblique_left_handed_geometry()},
          {"tilted", tilted_geometry()},
          {"far", far_geometry()},
          {"oblique_far", oblique_far_geometry()}};
}

#define ISOMESH_INSTANTIATE(T, name, kType)                                                 \
  template SampleVolume<T> sample(const Field&, const mesh::Dims&, const Geometry&);        \
  template SampleVolume<T> noise(const std::vector<T>&, const mesh::Dims&, std::uint64_t,   \
                                 const Geometry&);                                          \
  template SampleVolume<T> noise_between(double, double, const mesh::Dims&, std::uint64_t); \
  template SampleVolume<T> constant(T, const mesh::Dims&);                                  \
  template SampleVolume<T> checkerboard(T, T, const mesh::Dims&);                           \
  template void set_border(SampleVolume<T>&, T);                                            \
  template SampleVolume<T> sign_pattern(unsigned, Parity, Surround);

ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::test
