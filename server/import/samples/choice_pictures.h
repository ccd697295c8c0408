// Small pictures by which a person tells apart what an error offers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/files.h"
#include "proto/error.h"
#include "server/import/source/source.h"

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

// Returns the error, which offers the volumes of a file, with the middle slice of each, all by the
// window of the first; `source` describes the first. They are smaller the more there are. Without
// pictures if the samples are not plain and one volume after the other, or cannot be read.
Error with_pictures(const Error& error, const InputFile& file, const SourceVolume& source,
                    const std::filesystem::path& scratch);

}  // namespace isomesh::import
