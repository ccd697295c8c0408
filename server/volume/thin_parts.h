// Keeps what is thin in a reduced volume: blocks that a sheet passes have little of it, and their
// means would turn it into stripes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace isomesh::volume {

// Parts that are thinner than two blocks, brighter or darker than all around, get their own value;
// all else keeps the means.
class ThinParts {
 public:
  // One layer, or something that is derived of it.
  using Greys = std::vector<std::uint8_t>;

  // Greys of the blocks of one layer, row by row.
  struct Layer {
    Greys mean;
    Greys least;
    Greys greatest;
  };

  ThinParts(std::uint32_t width, std::uint32_t height) : width_(width), height_(height) {}

  // Layers on either side that tell what a layer becomes.
  static constexpr std::size_t kReach = 2;

  // A layer as it and its neighbours need it. All but the means have a border of kReach, which
  // repeats the last values; dark ones are subtracted from 255.
  struct KnownLayer {
    Greys mean;
    Greys bright;
    Greys dark;
    // The least of each square of two by two, of what is bright and of what is dark.
    Greys bright_squares;
    Greys dark_squares;
  };

  using NeighbouringLayers = std::array<const KnownLayer*, 2 * kReach + 1>;

  KnownLayer known(Layer layer) const;

  // The layer in the middle of its neighbours; at the ends of the volume the last one is repeated.
  Greys kept(const NeighbouringLayers& around) const;

 private:
  // Each value with the bits of `mask` turned over.
  Greys bordered(const Greys& plane, std::uint8_t mask) const;

  std::size_t stride() const { return width_ + 2 * kReach; }

  std::uint32_t width_;
  std::uint32_t height_;
};

}  // namespace isomesh::volume
