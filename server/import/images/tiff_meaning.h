// The meaning of a TIFF's pages, as OME-TIFF and ImageJ write it into the description of the first.
#pragma once

#include <array>
#include <cstdint>
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

  // The page of a slice in the volume of that index; channels count before times.
  std::uint64_t page_of(std::uint64_t volume, std::uint64_t slice) const;
};

// Pixels in one unit of the description along x and y; 0 if unknown.
struct TiffResolution {
  double x = 0;
  double y = 0;
};

// Without a description that is understood, all pages are slices. Throws Error kUnusableVolume if
// the description calibrates values by another function than a straight line.
TiffMeaning tiff_meaning(std::string_view description, const TiffResolution& resolution,
                         std::uint64_t pages);

// Throws Error kUnusableVolume if the meaning contradicts the number of pages of the file. Files of
// one page each may tell of the whole volume.
void check_pages(const TiffMeaning& meaning, std::uint64_t pages);

}  // namespace isomesh::import
