// Samples on a lattice, and the map from lattice to space.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "proto/types.h"

namespace isomesh::mesh {

// Number of samples along x, y and z.
struct Dims {
  std::uint32_t x = 0;
  std::uint32_t y = 0;
  std::uint32_t z = 0;

  std::uint64_t samples() const { return std::uint64_t{x} * y * z; }
  bool has_cells() const { return x > 1 && y > 1 && z > 1; }
};

// The offset from a sample to corner 0..7 of its cell, in x-fastest order.
inline std::ptrdiff_t sample_offset(const Dims& dims, unsigned corner) {
  const std::ptrdiff_t row = dims.x;
  return (corner & 1) + (corner >> 1 & 1) * row +
         (corner >> 2) * row * static_cast<std::ptrdiff_t>(dims.y);
}

// p = origin + step_x * i + step_y * j + step_z * k, in millimetres.
struct LatticeToSpace {
  std::array<double, 3> origin = {0, 0, 0};
  std::array<double, 3> step_x = {1, 0, 0};
  std::array<double, 3> step_y = {0, 1, 0};
  std::array<double, 3> step_z = {0, 0, 1};

  // Negative for a left-handed lattice.
  double determinant() const;
};

LatticeToSpace lattice_to_space(const Geometry& geometry);

// A unit of length near the steps, in millimetres, for products of several lengths in single
// precision. It is a power of two, so it changes no digit; 1 for steps between 1/256 and 256
// mm.
double unit_mm(const LatticeToSpace& to_space);

// The fractional indices i, j and k of a point. The steps must not be in one plane.
std::array<double, 3> index_of(const LatticeToSpace& to_space, const std::array<double, 3>& point);

// Samples in x-fastest order, dims.samples() of them, finite. Does not own them.
template <class T>
struct Lattice {
  const T* samples = nullptr;
  Dims dims;
  LatticeToSpace to_space;
};

}  // namespace isomesh::mesh
