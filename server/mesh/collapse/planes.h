// The planes between the tetrahedra of a scheme; private to this folder.
//
// All faces of a scheme's tetrahedra lie in a few families of parallel planes. The planes of a
// family are where one number, linear in the place, is whole. Where planes of two families meet
// there are lines through samples, in a few directions, and the tetrahedra's edges lie on them.
//  * six-way: x, y, z, x-y, y-z, x-z, and lines in 7 directions;
//  * five-way: x, y, z, (x+y+z)/2, (-x+y+z)/2, (x-y+z)/2, (x+y-z)/2, counted from a sample of even
//    i+j+k, and lines in 9 directions: along the axes, and through even samples along the diagonals
//    of faces;
//  * body-centred: u = y+z, v = x+z, w = x+y, u-v, v-w, u-w, and lines in 7 directions. All of
//    u, v and w are whole at samples and at centres alone, and the tetrahedra are the six-way ones
//    between them. Cells with a phantom are split in six, and so are faces at the border: x, y, z,
//    and lines in 3 more directions, along the diagonals of faces.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "server/mesh/collapse/vec.h"

namespace isomesh::mesh::collapse {

// A place by its numbers of families, of which x, y and z are the first, counted from some sample.
// Those of no family never meet a plane.
template <std::size_t kPlaces>
struct alignas(32) NumbersOf {
  std::array<float, kPlaces> of;
};

// The lines of one direction: the two families whose numbers i and j tell them apart, and the one
// whose number k counts the samples along a line. Sample (i, j, k) is so many steps along x, y, z
// away; on the body-centred lattice the place is so many half steps away.
struct LineDirection {
  std::uint8_t first;
  std::uint8_t second;
  std::uint8_t along;
  std::array<std::int8_t, 3> per_first;
  std::array<std::int8_t, 3> per_second;
  std::array<std::int8_t, 3> per_along;
};

// From a sample to the next ones.
struct SampleSteps {
  std::ptrdiff_t x = 1;
  std::ptrdiff_t y = 0;
  std::ptrdiff_t z = 0;
  std::ptrdiff_t centre = 0;  // to the centre of its cell, on the body-centred lattice

  std::ptrdiff_t to(const std::array<std::int8_t, 3>& steps) const {
    return steps[0] * x + steps[1] * y + steps[2] * z;
  }
};

struct SixPlanes {
  using Numbers = NumbersOf<8>;
  static constexpr std::size_t kFamilies = 6;
  static constexpr std::array<LineDirection, 7> kLines = {{
      {1, 2, 0, {0, 1, 0}, {0, 0, 1}, {1, 0, 0}},
      {0, 2, 1, {1, 0, 0}, {0, 0, 1}, {0, 1, 0}},
      {0, 1, 2, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
      {3, 2, 1, {1, 0, 0}, {0, 0, 1}, {1, 1, 0}},
      {5, 1, 2, {1, 0, 0}, {0, 1, 0}, {1, 0, 1}},
      {4, 0, 2, {0, 1, 0}, {1, 0, 0}, {0, 1, 1}},
      {3, 4, 2, {1, 0, 0}, {1, 1, 0}, {1, 1, 1}},
  }};

  // The sample before a place, to count from.
  static Vecd base_of(Vecd cell) { return cell; }
  static Numbers numbers(Vecf d) {
    return {{d.x, d.y, d.z, d.x - d.y, d.y - d.z, d.x - d.z, 0.5F, 0.5F}};
  }
  // F in a cell at the place (a, b, c) in it.
  static double value(const float* corner, const SampleSteps& steps, bool is_odd, Vecd in_cell);
};

struct FivePlanes {
  using Numbers = NumbersOf<8>;
  static constexpr std::size_t kFamilies = 7;
  static constexpr std::array<LineDirection, 9> kLines = {{
      {1, 2, 0, {0, 1, 0}, {0, 0, 1}, {1, 0, 0}},
      {0, 2, 1, {1, 0, 0}, {0, 0, 1}, {0, 1, 0}},
      {0, 1, 2, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
      {0, 5, 1, {1, 0, -1}, {0, 0, 2}, {0, 1, 1}},
      {0, 3, 2, {1, -1, 0}, {0, 2, 0}, {0, -1, 1}},
      {1, 6, 2, {-1, 1, 0}, {2, 0, 0}, {1, 0, 1}},
      {1, 3, 2, {-1, 1, 0}, {2, 0, 0}, {-1, 0, 1}},
      {2, 5, 1, {-1, 0, 1}, {2, 0, 0}, {1, 1, 0}},
      {2, 3, 1, {-1, 0, 1}, {2, 0, 0}, {-1, 1, 0}},
  }};

  static Vecd base_of(Vecd cell) {
    const double sum = cell.x + cell.y + cell.z;
    return sum / 2 == std::floor(sum / 2) ? cell : cell + Vecd{1, 0, 0};
  }
  static Numbers numbers(Vecf d) {
    const float half = 0.5F;
    return {{d.x, d.y, d.z, (d.x + d.y + d.z) * half, (d.y - d.x + d.z) * half,
             (d.x - d.y + d.z) * half, (d.x + d.y - d.z) * half, half}};
  }
  static double value(const float* corner, const SampleSteps& steps, bool is_odd, Vecd in_cell);
};

constexpr std::array<LineDirection, 10> bcc_lines() {
  std::array<LineDirection, 10> lines = {};
  constexpr std::uint8_t kFirst = 3;  // of u, v and w
  const auto half_steps = [](const std::array<std::int8_t, 3>& steps) {
    const auto& [u, v, w] = steps;
    return std::array{static_cast<std::int8_t>(v + w - u), static_cast<std::int8_t>(u + w - v),
                      static_cast<std::int8_t>(u + v - w)};
  };
  for (std::size_t d = 0; d < SixPlanes::kLines.size(); ++d) {
    const LineDirection& six = SixPlanes::kLines[d];
    lines[d].first = six.first + kFirst;
    lines[d].second = six.second + kFirst;
    lines[d].along = six.along + kFirst;
    lines[d].per_first = half_steps(six.per_first);
    lines[d].per_second = half_steps(six.per_second);
    lines[d].per_along = half_steps(six.per_along);
  }
  lines[7] = {6, 2, 1, {-2, 0, 0}, {0, 0, 2}, {2, 2, 0}};
  lines[8] = {7, 0, 2, {0, -2, 0}, {2, 0, 0}, {0, 2, 2}};
  lines[9] = {8, 1, 2, {-2, 0, 0}, {0, 2, 0}, {2, 0, 2}};
  return lines;
}

struct BccPlanes {
  using Numbers = NumbersOf<16>;
  static constexpr std::size_t kFamilies = 9;
  static constexpr std::array<LineDirection, 10> kLines = bcc_lines();

  static Vecd base_of(Vecd cell) { return cell; }
  static Numbers numbers(Vecf d) {
    return {{d.x, d.y, d.z, d.y + d.z, d.x + d.z, d.x + d.y, d.y - d.x, d.z - d.y, d.z - d.x}};
  }
  static double value(const float* corner, const SampleSteps& steps, bool is_odd, Vecd in_cell);
};

}  // namespace isomesh::mesh::collapse
