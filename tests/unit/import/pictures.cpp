#include "tests/unit/import/pictures.h"

#include <algorithm>

#include <zlib.h>

#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

template <class Number>
std::string number(Number value, bool big_endian = false) {
  return bytes_of(std::vector<Number>{value}, big_endian);
}

std::string chunk(const std::string& kind, const std::string& data) {
  const std::string both = kind + data;
  const auto sum =
      crc32(0, reinterpret_cast<const Bytef*>(both.data()), static_cast<uInt>(both.size()));
  return number(static_cast<std::uint32_t>(data.size()), true) + both +
         number(static_cast<std::uint32_t>(sum), true);
}

std::string entry(std::uint16_t tag, std::uint16_t type, std::uint32_t count, std::uint32_t value) {
  return number(tag) + number(type) + number(count) + number(value);
}

}  // namespace

std::string png_picture(const PictureFields& fields, std::string_view rows) {
  const std::size_t row = rows.size() / fields.height;
  std::string filtered;
  for (std::size_t at = 0; at < rows.size(); at += row) {
    filtered += '\0' + std::string(rows.substr(at, row));
  }
  std::string palette;
  for (const auto& colour : fields.palette) {
    for (const std::uint8_t part : colour) palette += static_cast<char>(part);
  }
  const int type =
      !palette.empty() ? 3 : (fields.components >= 3 ? 2 : 0) + (fields.has_opacity ? 4 : 0);
  return "\x89PNG\r\n\x1a\n" +
         chunk("IHDR", number(fields.width, true) + number(fields.height, true) +
                           static_cast<char>(fields.bits) + static_cast<char>(type) +
                           std::string(3, '\0')) +
         (palette.empty() ? "" : chunk("PLTE", palette)) + chunk("IDAT", zlib(filtered)) +
         chunk("IEND", "");
}

std::string bmp_picture(const PictureFields& fields, std::string_view rows) {
  const std::size_t row = rows.size() / fields.height;
  const bool has_masks = fields.has_opacity;
  std::string palette;
  for (const auto& [red, green, blue] : fields.palette) {
    for (const std::uint8_t part : {blue, green, red}) palette += static_cast<char>(part);
    palette += '\0';
  }
  const std::uint32_t header = has_masks ? 108 : 40;
  std::string file =
      "BM" + number<std::uint32_t>(0) + number<std::uint32_t>(0) +
      number(static_cast<std::uint32_t>(14 + header + palette.size())) + number(header) +
      number(fields.width) + number(fields.height) + number<std::uint16_t>(1) +
      number(static_cast<std::uint16_t>(fields.bits * fields.components)) +
      number<std::uint32_t>(has_masks ? 3 : 0) + std::string(12, '\0') +
      number(static_cast<std::uint32_t>(fields.palette.size())) + number<std::uint32_t>(0);
  if (has_masks) file += bytes_of(std::vector<std::uint32_t>{0xff0000, 0xff00, 0xff, 0xff000000});
  file.resize(14 + header, '\0');
  file += palette;
  for (std::size_t end = rows.size(); end > 0; end -= row) {
    file += std::string(rows.substr(end - row, row)) + std::string((4 - row % 4) % 4, '\0');
  }
  return file;
}

std::string tiff_picture(const PictureFields& fields, const std::vector<std::string>& pages) {
  std::string file = "II*" + std::string(1, '\0') + number<std::uint32_t>(0);
  std::size_t link = 4;
  const auto size = [&] { return static_cast<std::uint32_t>(file.size()); };
  for (const std::string& page : pages) {
    const std::uint32_t samples = size();
    file += page + std::string(page.size() % 2, '\0');
    const std::uint32_t map = size();
    const std::size_t colours = std::size_t{1} << fields.bits;
    for (std::size_t part = 0; part < 3 && !fields.palette.empty(); ++part) {
      for (std::size_t at = 0; at < colours; ++at) {
        const unsigned value = at < fields.palette.size() ? fields.palette[at][part] : 0;
        file += number(static_cast<std::uint16_t>(value * 257));
      }
    }
    const std::uint32_t description = size();
    file += fields.description;
    if (file.size() % 2 != 0) file += '\0';
    const std::uint32_t depths = size();
    for (int at = 0; at < fields.components; ++at) file += number(fields.bits);
    const bool is_one = fields.components == 1;
    // Two numbers stand in the entry itself.
    const std::uint32_t bits = is_one                   ? fields.bits
                               : fields.components == 2 ? fields.bits * 65537U
                                                        : depths;
    std::vector<std::string> entries = {entry(256, 3, 1, fields.width),
                                        entry(257, 3, 1, fields.height),
                                        entry(258, 3, fields.components, bits),
                                        entry(259, 3, 1, 1),
                                        entry(262, 3, 1,
                                              !fields.palette.empty()  ? 3
                                              : fields.components >= 3 ? 2
                                                                       : fields.photometric),
                                        entry(273, 4, 1, samples),
                                        entry(277, 3, 1, fields.components),
                                        entry(278, 3, 1, fields.height),
                                        entry(279, 4, 1, static_cast<std::uint32_t>(page.size()))};
    if (!fields.description.empty()) {
      const auto letters = static_cast<std::uint32_t>(fields.description.size());
      entries.insert(entries.begin() + 5, entry(270, 2, letters, description));
    }
    if (!fields.palette.empty()) {
      entries.push_back(entry(320, 3, static_cast<std::uint32_t>(3 * colours), map));
    }
    if (fields.has_opacity) entries.push_back(entry(338, 3, 1, 2));
    if (is_one) entries.push_back(entry(339, 3, 1, fields.format));
    std::ranges::copy(number(size()), file.begin() + static_cast<std::ptrdiff_t>(link));
    file += number(static_cast<std::uint16_t>(entries.size()));
    for (const std::string& each : entries) file += each;
    link = file.size();
    file += number<std::uint32_t>(0);
  }
  return file;
}

}  // namespace isomesh::import::test
