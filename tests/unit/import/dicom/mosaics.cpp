#include "tests/unit/import/dicom/mosaics.h"

#include <algorithm>
#include <string>
#include <vector>

#include "server/import/dicom/elements/private_elements.h"
#include "server/import/dicom/elements/tags.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {

using namespace dicom;

namespace {

// Tiles in rows of `across`, of which those behind the last slice are empty.
std::string tiles(std::uint32_t across, std::uint32_t down) {
  std::vector<std::uint16_t> samples;
  for (std::uint32_t y = 0; y < down * kTileRows; ++y) {
    for (std::uint32_t x = 0; x < across * kTileColumns; ++x) {
      const std::uint32_t k = y / kTileRows * across + x / kTileColumns;
      samples.push_back(k < kTiles ? tile_sample(x % kTileColumns, y % kTileRows, k) : 0);
    }
  }
  return bytes_of(samples);
}

std::string number(std::uint64_t value) {
  return bytes_of(std::vector{static_cast<std::uint32_t>(value)});
}

std::string filled(std::string text, std::size_t size) {
  text.resize(size, '\0');
  return text;
}

}  // namespace

std::string csa_header(const CsaFields& fields, bool is_newer) {
  std::string bytes = is_newer ? "SV10\4\3\2\1" : "";
  bytes += number(fields.size()) + number(77);
  for (const auto& [name, values] : fields) {
    bytes += filled(name, 64) + number(values.size()) + filled("FD", 4) + number(4);
    // Scanners write six items, whatever is in them.
    const std::size_t items = std::max<std::size_t>(values.size(), 6);
    bytes += number(items) + number(205);
    for (std::size_t item = 0; item < items; ++item) {
      const std::string value = item < values.size() ? values[item] + '\0' : "";
      const std::size_t length = value.size();
      bytes += number(length) + number(length) + number(77) + number(length);
      bytes += filled(value, (length + 3) / 4 * 4);
    }
  }
  return bytes;
}

std::uint16_t tile_sample(std::uint32_t i, std::uint32_t j, std::uint32_t k) {
  return static_cast<std::uint16_t>(k * 100 + j * 10 + i + 1);
}

DicomObject tiled_object(std::uint32_t across, std::uint32_t down) {
  const DicomSeries series = {.columns = across * kTileColumns,
                              .rows = down * kTileRows,
                              .between_rows = 2,
                              .between_columns = 3,
                              .bits_stored = 16,
                              .high_bit = 15};
  return series.slice(0).text(kImagePosition, "DS", "10\\20\\30").pixels(tiles(across, down), 2);
}

CsaFields csa_fields(const std::vector<std::string>& normal) {
  return {{"EchoLinePosition", {"32      "}},
          {"NumberOfImagesInMosaic", {"5       "}},
          {"SliceNormalVector", normal}};
}

DicomObject siemens_mosaic(const CsaFields& fields, bool is_newer) {
  return tiled_object(3, 3)
      .text(kImageType, "CS", "ORIGINAL\\PRIMARY\\M\\ND\\MOSAIC")
      .text(kSpacingBetweenSlices, "DS", "4.5")
      .text(0x00290010, "LO", "SIEMENS CSA HEADER")
      .bytes(kCsaImageHeader, "OB", csa_header(fields, is_newer));
}

DicomObject siemens_mosaic() { return siemens_mosaic(csa_fields({"0", "0", "1"})); }

DicomObject protocol_mosaic(bool is_reversed) {
  // The centre of the first tile is at (19, 24) plus half of the tile's extent.
  const int low = is_reversed ? 30 - 4 * 4 : 30;
  const std::string protocol =
      "SV10 some binary fields\n### ASCCONV BEGIN object=MrProtDataImpl ###\n"
      "sSliceArray.asSlice[0].sPosition.dSag = 22\n"
      "sSliceArray.asSlice[0].sPosition.dTra\t=\t" +
      std::to_string(low) + "\n" +
      "sSliceArray.asSlice[0].sNormal.dTra   = 1\n"
      "sSliceArray.asSlice[4].sPosition.dSag = 22\n"
      "sSliceArray.asSlice[4].sPosition.dTra = " +
      std::to_string(low + 4 * 4) + "\n" +
      "sSliceArray.lSize                     = 5\n### ASCCONV END ###\n";
  return siemens_mosaic()
      .erase(kCsaImageHeader)
      .erase(kSpacingBetweenSlices)
      .bytes(kCsaSeriesHeader, "OB", protocol + std::string(protocol.size() % 2, ' '));
}

DicomObject united_imaging_grid() {
  std::vector<DicomObject> frames;
  for (std::uint32_t k = 0; k < kTiles; ++k) {
    frames.push_back(
        DicomObject().text(kImagePosition, "DS", "1\\2\\" + std::to_string(30 - 4 * int(k))));
  }
  return tiled_object(3, 2)
      .text(kImageType, "CS", "ORIGINAL\\PRIMARY\\M\\VFRAME")
      .text(0x00650010, "LO", "Image Private Header")
      .text(kGridImages, "DS", "5")
      .items(kGridFrames, frames);
}

}  // namespace isomesh::import::test
