#include "server/import/source/choice_picture.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <vector>

#include "base/base64.h"

namespace isomesh::import {
namespace {

constexpr double kDarkest = 0.02;  // shares of the pixels
constexpr double kBrightest = 0.99;

}  // namespace

GreyWindow window_of(std::span<const double> values) {
  std::vector<double> finite;
  std::ranges::copy_if(values, std::back_inserter(finite),
                       [](double value) { return std::isfinite(value); });
  if (finite.empty()) return {};
  std::ranges::sort(finite);
  const auto at = [&](double share) {
    return finite[static_cast<std::size_t>(share * static_cast<double>(finite.size() - 1))];
  };
  return {at(kDarkest), std::max(at(kBrightest) - at(kDarkest), 1e-9)};
}

ChoicePicture picture_of(std::span<const double> values, std::uint32_t width,
                         const GreyWindow& window) {
  std::vector<std::uint8_t> grey;
  for (const double value : values) {
    const double part = (value - window.black) / window.width;
    const double share = std::isfinite(value) ? std::clamp(part, 0.0, 1.0) : 0.0;
    grey.push_back(static_cast<std::uint8_t>(std::lround(255 * share)));
  }
  return {.width = width,
          .height = static_cast<std::uint32_t>(values.size() / width),
          .grey = to_base64(grey)};
}

}  // namespace isomesh::import
