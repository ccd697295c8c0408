#pragma once

#include <array>
#include <cmath>
#include <cstdint>

namespace isomesh::volume {

// Black (0) up to window[0] and for NaN, white (255) from window[1] on, linear between them.
inline std::uint8_t grey(double value, const std::array<double, 2>& window) {
  if (!(value > window[0])) return 0;
  if (value >= window[1]) return 255;
  // Halved, because the difference of two doubles may overflow.
  const double half_width = window[1] / 2 - window[0] / 2;
  return static_cast<std::uint8_t>(std::lround((value / 2 - window[0] / 2) / half_width * 255));
}

}  // namespace isomesh::volume
