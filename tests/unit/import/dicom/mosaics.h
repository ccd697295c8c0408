// Objects whose one frame holds five slices as tiles.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "tests/unit/import/dicom/objects.h"

namespace isomesh::import::test {

inline constexpr std::uint32_t kTileColumns = 3;
inline constexpr std::uint32_t kTileRows = 2;
inline constexpr std::uint32_t kTiles = 5;

std::uint16_t tile_sample(std::uint32_t i, std::uint32_t j, std::uint32_t k);

// A slice of 3 x 2 mm a sample at (10, 20, 30), of so many tiles, of which those behind the last
// slice are empty.
DicomObject tiled_object(std::uint32_t across, std::uint32_t down);

// The header of their own that Siemens' scanners write, with `is_newer` in the layout that begins
// with "SV10".
using CsaFields = std::vector<std::pair<std::string, std::vector<std::string>>>;
std::string csa_header(const CsaFields& fields, bool is_newer = true);

CsaFields csa_fields(const std::vector<std::string>& normal);

// Three by three tiles, so that the first tile lies 3 columns of 3 mm and 2 rows of 2 mm from where
// the position says.
DicomObject siemens_mosaic(const CsaFields& fields, bool is_newer = true);
DicomObject siemens_mosaic();

// The same without the header of the image: the protocol names the slices. With `is_reversed` its
// first slice is the last tile.
DicomObject protocol_mosaic(bool is_reversed);

// Three by two tiles, 4 mm apart, from the highest to the lowest.
DicomObject united_imaging_grid();

}  // namespace isomesh::import::test
