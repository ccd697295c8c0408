// The meaning of a TIFF's pages, as OME-TIFF, ImageJ, SCIFIO and tifffile write it into the
// description of the first.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/notes.h"
#include "server/import/source/stored_samples.h"

namespace isomesh::import {

struct TiffMeaning {
  std::string order = "XYZCT";  // of the pages, the fastest first, as in OME
  std::uint64_t slices = 0;
  std::uint64_t channels = 1;
  std::uint64_t times = 1;
  // Millimetres; empty unless all three are known.
  std::optional<std::array<double, 3>> spacing = {};
  std::optional<Rescale> rescale = {};
  // The pages of the planes in this file, by their numbers in `order`. Empty if each page is the
  // plane of its number.
  std::optional<std::map<std::uint64_t, std::uint64_t>> page_of_plane = {};

  // The volumes of which this file has planes; channels count before times.
  std::vector<std::uint64_t> volumes() const;

  // The page of a slice in a volume. Throws Error kUnusableVolume if this file does not have it.
  std::uint64_t page_of(std::uint64_t volume, std::uint64_t slice) const;

  // The number in `order` of a volume's slice, and the volume of a plane.
  std::uint64_t plane_of(std::uint64_t volume, std::uint64_t slice) const;
  std::uint64_t volume_of(std::uint64_t plane) const;

 private:
  std::uint64_t size_of(char axis) const;
};

// Pixels in one unit of the description along x and y; 0 if unknown.
struct TiffResolution {
  double x = 0;
  double y = 0;
};

// Without a description that is understood, all pages are slices. Throws Error kUnusableVolume if
// the description has more than three axes that are not understood, or calibrates values by another
// function than a straight line.
TiffMeaning tiff_meaning(std::string_view description, const TiffResolution& resolution,
                         std::uint64_t pages);

// The number of images that ImageJ tells of; 0 without its description.
std::uint64_t imagej_images(std::string_view description);

// "3 slices, 2 channels and 1 times"
std::string counts_of(const TiffMeaning& meaning);

// Throws Error kUnusableVolume if the meaning contradicts the number of pages of the file. Files of
// one page each may tell of the whole volume.
void check_pages(const TiffMeaning& meaning, std::uint64_t pages);

}  // namespace isomesh::import
