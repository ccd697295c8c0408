// Samples as eight bits of grey.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

namespace isomesh::volume {

// Black (0) for window[0] and less and for what is no number, white (255) for window[1] and more,
// and in proportion between them.
inline std::uint8_t grey(double value, const std::array<double, 2>& window) {
  if (!(value > window[0])) return 0;
  if (value >= window[1]) return 255;
  // Halves, because the difference of two doubles may be beyond the largest double.
  const double half_width = window[1] / 2 - window[0] / 2;
  return static_cast<std::uint8_t>(std::lround((value / 2 - window[0] / 2) / half_width * 255));
}

}  // namespace isomesh::volume
