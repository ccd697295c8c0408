// Vectors of three numbers; private to this folder.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "server/mesh/lattice/lattice.h"

namespace isomesh::mesh::collapse {

template <class T>
struct Vec {
  T x = 0;
  T y = 0;
  T z = 0;

  friend Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend Vec operator*(Vec a, T s) { return {a.x * s, a.y * s, a.z * s}; }
  bool operator==(const Vec&) const = default;
};

using Vecf = Vec<float>;
using Vecd = Vec<double>;

template <class T>
T dot(Vec<T> a, Vec<T> b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

template <class T>
Vec<T> cross(Vec<T> a, Vec<T> b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

template <class T>
T length(Vec<T> a) {
  return std::sqrt(dot(a, a));
}

inline Vecd wide(Vecf a) { return {a.x, a.y, a.z}; }
inline Vecf narrow(Vecd a) {
  return {static_cast<float>(a.x), static_cast<float>(a.y), static_cast<float>(a.z)};
}

// Between numbers of samples and millimetres. Immutable.
class Metric {
 public:
  explicit Metric(const LatticeToSpace& map)
      : origin_{map.origin[0], map.origin[1], map.origin[2]},
        x_{map.step_x[0], map.step_x[1], map.step_x[2]},
        y_{map.step_y[0], map.step_y[1], map.step_y[2]},
        z_{map.step_z[0], map.step_z[1], map.step_z[2]},
        determinant_(dot(cross(x_, y_), z_)),
        back_x_(cross(y_, z_) * (1 / determinant_)),
        back_y_(cross(z_, x_) * (1 / determinant_)),
        back_z_(cross(x_, y_) * (1 / determinant_)) {}

  // A difference of numbers of samples as one of millimetres, and back.
  Vecd mm(Vecd d) const { return x_ * d.x + y_ * d.y + z_ * d.z; }
  Vecf mm(Vecf d) const { return narrow(mm(wide(d))); }
  Vecd steps(Vecd d) const { return {dot(back_x_, d), dot(back_y_, d), dot(back_z_, d)}; }
  // The same of places.
  Vecd place(Vecd at) const { return origin_ + mm(at); }
  Vecd index(Vecd place) const { return steps(place - origin_); }

  // The same space with numbers that begin so many samples earlier.
  Metric before(std::uint32_t samples) const {
    Metric metric = *this;
    metric.origin_ = origin_ - mm(Vecd{1, 1, 1} * samples);
    return metric;
  }

  // The same space in a unit of so many millimetres.
  Metric in_units_of(double mm) const {
    const auto scaled = [&](Vecd step) {
      return std::array{step.x / mm, step.y / mm, step.z / mm};
    };
    return Metric({scaled(origin_), scaled(x_), scaled(y_), scaled(z_)});
  }

  // The length in millimetres of the longest way across a cell.
  double largest_step() const { return length(x_) + length(y_) + length(z_); }
  // The least distance between two planes of samples.
  double least_step() const {
    return 1 / std::max(length(back_x_), std::max(length(back_y_), length(back_z_)));
  }
  bool is_left_handed() const { return determinant_ < 0; }
  // The factor for a cross product of vectors in millimetres: with it, the product points to the
  // same side as in numbers of samples.
  float turn() const { return determinant_ < 0 ? -1.0F : 1.0F; }

 private:
  Vecd origin_, x_, y_, z_;
  double determinant_;
  Vecd back_x_, back_y_, back_z_;
};

}  // namespace isomesh::mesh::collapse
