// Pictures of all kinds of pixels, written plainly and apart from the importers.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace isomesh::import::test {

struct PictureFields {
  std::uint32_t width = 4;
  std::uint32_t height = 3;
  std::uint16_t bits = 8;        // of a component
  std::uint16_t components = 1;  // 1 or 3, and one more with an opacity
  bool has_opacity = false;
  std::vector<std::array<std::uint8_t, 3>> palette = {};
  std::uint16_t format = 1;       // of TIFF: 1 unsigned, 2 signed, 3 float
  std::uint16_t photometric = 1;  // of grey TIFF: 0 if 0 is white
  std::string description = {};   // of TIFF; empty or longer than four bytes
};

// `rows` are the picture's rows of whole bytes from top to bottom, as each format stores them: BMP
// has blue in front of green and red, the others have red first. PNG's numbers are big-endian.
std::string png_picture(const PictureFields& fields, std::string_view rows);
std::string bmp_picture(const PictureFields& fields, std::string_view rows);
// Little-endian, without compression; a page for each text of rows.
std::string tiff_picture(const PictureFields& fields, const std::vector<std::string>& pages);

}  // namespace isomesh::import::test
