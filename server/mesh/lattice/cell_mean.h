// The mean of a cell's eight samples, which is the value of its centre on the body-centred lattice
// (bcc_faces.h). The sums of integers are exact. Those of others are in double precision, in an
// order that is always the same. A centre is inside if the mean is, before it is rounded to less.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include <hwy/base.h>

namespace isomesh::mesh {

// The sum of the eight samples of a cell, of which `first` is corner 0. `row` and `plane` are the
// steps to the next samples along y and z.
template <class T>
HWY_INLINE auto sum_of_cell(const T* first, std::ptrdiff_t row, std::ptrdiff_t plane) {
  using Sum = std::conditional_t<sizeof(T) <= 2, std::int32_t, std::int64_t>;
  Sum sum = 0;
  for (const T* at : {first, first + row, first + plane, first + row + plane}) {
    sum += static_cast<Sum>(at[0]) + static_cast<Sum>(at[1]);
  }
  return sum;
}

// The mean of those.
template <class T>
HWY_INLINE double mean_of_cell(const T* first, std::ptrdiff_t row, std::ptrdiff_t plane) {
  constexpr double kEighth = 0.125;
  if constexpr (std::is_integral_v<T>) {
    return static_cast<double>(sum_of_cell(first, row, plane)) * kEighth;
  } else {
    const auto face = [&](const T* at, double scale) {
      const auto value = [&](std::ptrdiff_t offset) {
        return static_cast<double>(at[offset]) * scale;
      };
      return (value(0) + value(row)) + (value(plane) + value(row + plane));
    };
    const double mean = (face(first, 1) + face(first + 1, 1)) * kEighth;
    // Sums of doubles can overflow; those of their eighths cannot.
    if constexpr (std::is_same_v<T, double>) {
      if (!std::isfinite(mean)) return face(first, kEighth) + face(first + 1, kEighth);
    }
    return mean;
  }
}

}  // namespace isomesh::mesh
