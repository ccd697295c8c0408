#include "server/import/dicom/kinds/display_color.h"

#include <array>
#include <cmath>
#include <vector>

#include "server/import/dicom/elements/tags.h"
#include "server/import/labels/label_table.h"

namespace isomesh::import::dicom {
namespace {

using Triple = std::array<double, 3>;

// L* is 0..100 and a*, b* are -128..127; each spans all 16 bits.
Triple cie_lab(const std::vector<std::uint32_t>& stored) {
  constexpr double kMost = 0xFFFF;
  return {stored[0] / kMost * 100, stored[1] / kMost * 255 - 128, stored[2] / kMost * 255 - 128};
}

// CIE 15, from D65. The standard requires D50, the white point of profile connection spaces. But
// dcmqi and its descendants write sRGB's own white point, and their colours must be preserved.
Triple cie_xyz(const Triple& lab) {
  constexpr Triple kWhite = {0.95047, 1, 1.08883};
  constexpr double kLinearBelow = 6.0 / 29;
  const auto inverse = [](double t) {
    return t > kLinearBelow ? t * t * t : 3 * kLinearBelow * kLinearBelow * (t - 4.0 / 29);
  };
  const double y = (lab[0] + 16) / 116;
  return {kWhite[0] * inverse(y + lab[1] / 500), kWhite[1] * inverse(y),
          kWhite[2] * inverse(y - lab[2] / 200)};
}

// IEC 61966-2-1.
Triple srgb(const Triple& xyz) {
  constexpr std::array<Triple, 3> kFromXyz = {{{3.2404542, -1.5371385, -0.4985314},
                                               {-0.9692660, 1.8760108, 0.0415560},
                                               {0.0556434, -0.2040259, 1.0572252}}};
  Triple rgb = {};
  for (std::size_t at = 0; at < 3; ++at) {
    const Triple& row = kFromXyz[at];
    const double linear = row[0] * xyz[0] + row[1] * xyz[1] + row[2] * xyz[2];
    rgb[at] = linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
  }
  return rgb;
}

}  // namespace

std::optional<std::string> display_color(const DataSet& data) {
  const std::vector<std::uint32_t> stored = data.unsigned_numbers(kRecommendedDisplayCieLabValue);
  if (stored.size() != 3) return std::nullopt;
  return label_color(srgb(cie_xyz(cie_lab(stored))));
}

}  // namespace isomesh::import::dicom
