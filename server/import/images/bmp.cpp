#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "server/import/images/page.h"
#include "server/import/source/header_fields.h"
#include "server/import/source/names.h"

namespace isomesh::import {
namespace {

constexpr std::size_t kFileHeaderBytes = 14;
constexpr std::size_t kLeastHeaderBytes = 54;

// Indices of colours are samples only if colour i is grey i.
void check_palette(const InputFile& file, std::uint64_t offset, std::uint32_t count) {
  constexpr std::size_t kColours = 256;
  const std::size_t colours = count == 0 ? kColours : std::min<std::size_t>(count, kColours);
  const std::string palette = file.text(offset, colours * 4);
  for (std::size_t at = 0; at < palette.size(); ++at) {
    const auto part = static_cast<unsigned char>(palette[at]);
    if (at % 4 != 3 && part != at / 4) {
      throw_unusable("The BMP image has a palette of colours. Only grey images are supported.");
    }
  }
}

}  // namespace

bool is_bmp(std::string_view head) {
  if (head.size() < kLeastHeaderBytes || !head.starts_with("BM")) return false;
  const HeaderBytes header(head, false);
  const auto size = header.at<std::uint32_t>(kFileHeaderBytes);
  return (size == 40 || size == 108 || size == 124) && header.at<std::uint16_t>(26) == 1;
}

void read_bmp(const InputFile& file, const PageCheck& check, const PageSink& sink) {
  const std::string head = file.text(0, kLeastHeaderBytes);
  if (!is_bmp(head)) throw_unusable("The BMP header is damaged.");
  const HeaderBytes header(head, false);
  const auto width = header.at<std::int32_t>(18);
  const auto height = header.at<std::int32_t>(22);  // negative: from top to bottom
  const auto bits = header.at<std::uint16_t>(28);
  if (bits != 8 || header.at<std::uint32_t>(30) != 0) {
    throw_unusable("The BMP image has " + std::to_string(bits) +
                   " bits or is compressed. Only plain grey images of 8 bits are supported.");
  }
  if (width < 1 || height == 0 || height == INT32_MIN) {
    throw_unusable("The size of the BMP image is not plausible.");
  }
  const PageLayout layout = {static_cast<std::uint32_t>(width),
                             static_cast<std::uint32_t>(std::abs(height)), StoredType::kUint8};
  check_palette(file, kFileHeaderBytes + header.at<std::uint32_t>(14),
                header.at<std::uint32_t>(46));
  check(layout);
  const auto offset = header.at<std::uint32_t>(10);
  const std::uint64_t row_bytes = (std::uint64_t{layout.width} + 3) / 4 * 4;
  if (file.size() < offset || (file.size() - offset) / row_bytes < layout.height) {
    throw_unusable("The BMP image is truncated.");
  }
  std::vector<std::byte> row(layout.width);
  for (std::uint32_t y = 0; y < layout.height; ++y) {
    const std::uint64_t stored = height > 0 ? layout.height - 1 - y : y;
    file.read_exactly(offset + stored * row_bytes, row);
    sink(row);
  }
}

}  // namespace isomesh::import
