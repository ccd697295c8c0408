#include "server/volume/thin_parts.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace isomesh::volume {
namespace {

using Greys = ThinParts::Greys;
using KnownLayer = ThinParts::KnownLayer;
using NeighbouringLayers = ThinParts::NeighbouringLayers;

constexpr std::uint8_t kWhite = 255;

// Shares of the contrast around by which something stands out. Noise is mostly below the
// first.
constexpr float kNoise = 0.5F;
constexpr float kThin = 0.75F;

constexpr auto kLeast = [](std::uint8_t a, std::uint8_t b) { return std::min(a, b); };
constexpr auto kGreatest = [](std::uint8_t a, std::uint8_t b) { return std::max(a, b); };

// Each value with the one `offset` behind it; the last ones, which have none, stay. The result has
// memory of its own, without which compilers do not use wide registers.
Greys with_next(const Greys& plane, std::size_t offset, const auto& choose) {
  Greys result = plane;
  const auto next = plane.begin() + static_cast<std::ptrdiff_t>(offset);
  std::transform(next, plane.end(), plane.begin(), result.begin(), choose);
  return result;
}

Greys of_both(const Greys& one, const Greys& other, const auto& choose) {
  Greys result(one.size());
  std::transform(one.begin(), one.end(), other.begin(), result.begin(), choose);
  return result;
}

// The brightest of all that is at least two blocks thick and touches the block or a neighbour of
// it. A value's place in its plane is that of the first corner of what it was taken of.
Greys solid(const NeighbouringLayers& around, Greys KnownLayer::*squares, std::size_t stride) {
  Greys most = of_both(around[0]->*squares, around[1]->*squares, kLeast);
  for (std::size_t at = 1; at + 1 < around.size(); ++at) {
    most =
        of_both(most, of_both(around[at]->*squares, around[at + 1]->*squares, kLeast), kGreatest);
  }
  // Four along each axis.
  for (const std::size_t step : {std::size_t{1}, stride}) {
    for (const std::size_t times : {std::size_t{1}, std::size_t{2}})
      most = with_next(most, times * step, kGreatest);
  }
  return most;
}

// The brightest of the blocks up to kReach away.
Greys brightest(const NeighbouringLayers& around, Greys KnownLayer::*bordered, std::size_t stride) {
  Greys most = around[0]->*bordered;
  for (const KnownLayer* layer : around) most = of_both(most, layer->*bordered, kGreatest);
  // Five along each axis.
  for (const std::size_t step : {std::size_t{1}, stride}) {
    for (const std::size_t times : {1, 2, 1}) most = with_next(most, times * step, kGreatest);
  }
  return most;
}

float thinness(int value, int solid, int contrast) {
  if (2 * (value - solid) <= contrast) return 0;  // no more than kNoise, as nearly everywhere
  const float share = static_cast<float>(value - solid) / static_cast<float>(contrast);
  return std::clamp((share - kNoise) / (kThin - kNoise), 0.0F, 1.0F);
}

}  // namespace

Greys ThinParts::bordered(const Greys& plane, std::uint8_t mask) const {
  Greys result;
  result.reserve(stride() * (height_ + 2 * kReach));
  for (std::size_t y = 0; y < height_ + 2 * kReach; ++y) {
    const std::size_t row = std::min<std::size_t>(y - std::min(y, kReach), height_ - 1);
    const auto first = plane.begin() + static_cast<std::ptrdiff_t>(row * width_);
    result.insert(result.end(), kReach, *first);
    result.insert(result.end(), first, first + width_);
    result.insert(result.end(), kReach, *(first + width_ - 1));
  }
  std::ranges::transform(result, result.begin(),
                         [mask](std::uint8_t grey) -> std::uint8_t { return grey ^ mask; });
  return result;
}

KnownLayer ThinParts::known(Layer layer) const {
  const auto squares = [&](const Greys& plane) {
    return with_next(with_next(plane, 1, kLeast), stride(), kLeast);
  };
  return {.mean = std::move(layer.mean),
          .bright = bordered(layer.greatest, 0),
          .dark = bordered(layer.least, kWhite),
          .bright_squares = squares(bordered(layer.least, 0)),
          .dark_squares = squares(bordered(layer.greatest, kWhite))};
}

Greys ThinParts::kept(const NeighbouringLayers& around) const {
  const Greys solid_bright = solid(around, &KnownLayer::bright_squares, stride());
  const Greys solid_dark = solid(around, &KnownLayer::dark_squares, stride());
  const Greys high = brightest(around, &KnownLayer::bright, stride());
  const Greys low = brightest(around, &KnownLayer::dark, stride());
  const KnownLayer& layer = *around[kReach];
  Greys result = layer.mean;
  for (std::size_t y = 0; y < height_; ++y) {
    for (std::size_t x = 0; x < width_; ++x) {
      const std::size_t first = y * stride() + x;  // of what begins kReach before
      const std::size_t own = first + kReach * stride() + kReach;
      const int contrast = high[first] + low[first] - kWhite;
      const int bright = layer.bright[own];
      const int dark = layer.dark[own];
      // If both stand out, each of the other, there is neither.
      const float share = thinness(bright, solid_bright[first], contrast) -
                          thinness(dark, solid_dark[first], contrast);
      if (share == 0) continue;
      std::uint8_t& grey = result[y * width_ + x];
      const auto most = static_cast<float>(share > 0 ? bright - grey : grey + dark - kWhite);
      grey = static_cast<std::uint8_t>(std::lround(static_cast<float>(grey) + share * most));
    }
  }
  return result;
}

}  // namespace isomesh::volume
