#include "server/volume/thin_parts.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace isomesh::volume {
namespace {

using Greys = ThinParts::Greys;
using KnownLayer = ThinParts::KnownLayer;
using NeighbouringLayers = std::array<const KnownLayer*, 2 * ThinParts::kReach + 1>;

constexpr std::uint8_t kWhite = 255;

// Shares of the contrast around by which something stands out. Noise is mostly below the
// first.
constexpr float kNoise = 0.5F;
constexpr float kThin = 0.75F;

// Compares each value with the one `offset` behind it; the last ones, which have none, stay.
void least_of(Greys& plane, std::size_t offset) {
  for (std::size_t at = 0; at + offset < plane.size(); ++at) {
    plane[at] = std::min(plane[at], plane[at + offset]);
  }
}

void greatest_of(Greys& plane, std::size_t offset) {
  for (std::size_t at = 0; at + offset < plane.size(); ++at) {
    plane[at] = std::max(plane[at], plane[at + offset]);
  }
}

void take_greatest(Greys& plane, const Greys& other) {
  for (std::size_t at = 0; at < plane.size(); ++at) plane[at] = std::max(plane[at], other[at]);
}

// The brightest of all that is at least two blocks thick and touches the block or a neighbour of
// it. A value's place in its plane is that of the first corner of what it was taken of.
Greys solid(const NeighbouringLayers& around, Greys KnownLayer::*squares, std::size_t stride) {
  Greys most((*around[0].*squares).size());
  for (std::size_t at = 0; at + 1 < around.size(); ++at) {
    const Greys& one = *around[at].*squares;
    const Greys& next = *around[at + 1].*squares;
    for (std::size_t i = 0; i < most.size(); ++i) {
      most[i] = std::max(most[i], std::min(one[i], next[i]));
    }
  }
  // Four along each axis.
  for (const std::size_t step : {std::size_t{1}, stride}) {
    greatest_of(most, step);
    greatest_of(most, 2 * step);
  }
  return most;
}

// The brightest of the blocks up to kReach away.
Greys brightest(const NeighbouringLayers& around, Greys KnownLayer::*bordered, std::size_t stride) {
  Greys most = *around[0].*bordered;
  for (const KnownLayer* layer : around) take_greatest(most, *layer.*bordered);
  // Five along each axis.
  for (const std::size_t step : {std::size_t{1}, stride}) {
    greatest_of(most, step);
    greatest_of(most, 2 * step);
    greatest_of(most, step);
  }
  return most;
}

float thinness(int value, int solid, int contrast) {
  if (contrast <= 0) return 0;
  const float share = static_cast<float>(value - solid) / static_cast<float>(contrast);
  return std::clamp((share - kNoise) / (kThin - kNoise), 0.0F, 1.0F);
}

}  // namespace

Greys ThinParts::bordered(const Greys& plane, bool is_inverted) const {
  Greys result;
  result.reserve(stride() * (height_ + 2 * kReach));
  const std::uint8_t mask = is_inverted ? kWhite : 0;
  for (std::size_t y = 0; y < height_ + 2 * kReach; ++y) {
    const std::size_t row = std::min<std::size_t>(y - std::min(y, kReach), height_ - 1) * width_;
    for (std::size_t x = 0; x < stride(); ++x) {
      const std::size_t column = std::min<std::size_t>(x - std::min(x, kReach), width_ - 1);
      result.push_back(plane[row + column] ^ mask);
    }
  }
  return result;
}

Greys ThinParts::squares(const Greys& bordered) const {
  Greys result = bordered;
  least_of(result, 1);
  least_of(result, stride());
  return result;
}

KnownLayer ThinParts::known(Layer layer) const {
  KnownLayer known;
  known.bright = bordered(layer.greatest, false);
  known.dark = bordered(layer.least, true);
  known.bright_squares = squares(bordered(layer.least, false));
  known.dark_squares = squares(bordered(layer.greatest, true));
  known.layer = std::move(layer);
  return known;
}

Greys ThinParts::kept(const NeighbouringLayers& around) const {
  const Greys bright = solid(around, &KnownLayer::bright_squares, stride());
  const Greys dark = solid(around, &KnownLayer::dark_squares, stride());
  const Greys high = brightest(around, &KnownLayer::bright, stride());
  const Greys low = brightest(around, &KnownLayer::dark, stride());
  const Layer& layer = around[kReach]->layer;
  Greys result(layer.mean.size());
  for (std::size_t y = 0; y < height_; ++y) {
    for (std::size_t x = 0; x < width_; ++x) {
      const std::size_t at = y * width_ + x;
      // Of what begins kReach before.
      const std::size_t first = y * stride() + x;
      const int contrast = high[first] + low[first] - kWhite;
      const int mean = layer.mean[at];
      const int least = layer.least[at];
      const int greatest = layer.greatest[at];
      // Where both stand out of the other there is neither.
      const float share = thinness(greatest, bright[first], contrast) -
                          thinness(kWhite - least, dark[first], contrast);
      const auto most = static_cast<float>(share > 0 ? greatest - mean : mean - least);
      result[at] = static_cast<std::uint8_t>(std::lround(static_cast<float>(mean) + share * most));
    }
  }
  return result;
}

}  // namespace isomesh::volume
