// The meaning of a TIFF's pages, as OME-TIFF, ImageJ, SCIFIO and tifffile write it into the
// description of the first, and Zeiss into a tag of its own.
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

// The same of an OME-TIFF. Empty if the text is not OME-XML with images. Images in other files are
// left out, unless all are. Small faults of the text are passed over. Throws Error kUnusableVolume
// if it is damaged, or this file has several images.
std::optional<TiffMeaning> ome_meaning(std::string_view text, std::uint64_t pages);

// The same of the content of a Zeiss LSM's tag CZ_LSMINFO (34412). Empty if it is another. Throws
// Error kUnusableVolume for an order of pages that is not supported.
std::optional<TiffMeaning> lsm_meaning(std::string_view information);

// The number of images of which only the first may have a page; 0 if the description tells of none.
std::uint64_t images_behind_page(std::string_view description);

// "3 slices, 2 channels and 1 times"
std::string counts_of(const TiffMeaning& meaning);

// Throws Error kUnusableVolume if the meaning contradicts the number of pages of the file. Files of
// one page each may tell of the whole volume.
void check_pages(const TiffMeaning& meaning, std::uint64_t pages);

// --- Values in descriptions ----------------------------------------------------------------------

inline constexpr std::uint64_t kMostOfAKind = 1'000'000;

// The length of a unit in millimetres; empty for unknown units and for pixels.
std::optional<double> described_length(std::string_view unit);

// Empty if the text is no positive number.
std::optional<double> described_positive(std::string_view text);

// From 1 to kMostOfAKind, or else `otherwise`.
std::uint64_t described_count(std::string_view text, std::uint64_t otherwise);

}  // namespace isomesh::import
