// A small picture by which a person tells apart what an error offers.
#pragma once

#include <cstdint>
#include <span>

#include "proto/error.h"

namespace isomesh::import {

// Pixels along a side; a slice gives every so many samples, which is enough for such a picture.
inline constexpr std::uint32_t kMostPictureSide = 96;

// The values that are black, and by how much the white ones are above.
struct GreyWindow {
  double black = 0;
  double width = 1;
};

// From the darkest to the brightest of the finite values, except a few.
GreyWindow window_of(std::span<const double> values);

// Values that are not finite are black.
ChoicePicture picture_of(std::span<const double> values, std::uint32_t width,
                         const GreyWindow& window);

}  // namespace isomesh::import
