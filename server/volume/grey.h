#pragma once

#include <array>
#include <cmath>
#include <cstdint>

namespace isomesh::volume {

// Black (0) up to window[0] and for NaN, white (255) from window[1] on, linear between them.
inline std::uint8_t grey(double value, const std::array<double, 2>& window) {
  if (!(value > window[0])) return 0;
  if (value >= window[1]) return 255;
  // The difference of two doubles may overflow. That of their halves may not, but the halves of the
  // smallest numbers are rounded.
  const double width = window[1] - window[0];
  const double share = std::isinf(width)
                           ? (value / 2 - window[0] / 2) / (window[1] / 2 - window[0] / 2)
                           : (value - window[0]) / width;
  return static_cast<std::uint8_t>(std::lround(share * 255));
}

}  // namespace isomesh::volume
