#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>
#include <vector>

#include "server/import/images/page.h"
#include "server/import/images/pixels.h"
#include "server/import/source/header_fields.h"
#include "server/import/source/names.h"

namespace isomesh::import {
namespace {

constexpr std::size_t kFileHeaderBytes = 14;
constexpr std::size_t kLeastHeaderBytes = 54;
constexpr std::uint32_t kPlain = 0;   // without compression
constexpr std::uint32_t kMasked = 3;  // the same; masks name the bits of each colour

// Four bytes for each colour: blue, green, red and one that means nothing.
std::vector<Colour> palette_of(const InputFile& file, std::uint64_t offset, std::uint32_t count,
                               unsigned bits) {
  const std::size_t most = std::size_t{1} << bits;
  const std::string bytes =
      file.text(offset, (count == 0 ? most : std::min<std::size_t>(count, most)) * 4);
  std::vector<Colour> palette;
  for (std::size_t at = 0; at + 4 <= bytes.size(); at += 4) {
    const auto part = [&](std::size_t index) {
      return static_cast<std::uint8_t>(bytes[at + index]);
    };
    palette.push_back({part(2), part(1), part(0)});
  }
  if (palette.empty()) throw_unusable("The BMP image is truncated.");
  return palette;
}

// A fourth byte is an opacity only if a mask says so.
bool has_opacity(const HeaderBytes& header, const std::string& head) {
  constexpr std::size_t kMasks = 54;
  constexpr std::array<std::uint32_t, 3> kUsual = {0xff0000, 0xff00, 0xff};
  std::array<std::uint32_t, 4> masks = {};
  if (head.size() < kMasks + sizeof(masks)) throw_unusable("The BMP image is truncated.");
  header.read<std::uint32_t>(kMasks, masks);
  if (!std::ranges::equal(kUsual, std::span(masks).first(3))) {
    throw_unusable("The BMP image has an unusual order of colours. Save it with 8 or 24 bits.");
  }
  return header.at<std::uint32_t>(kFileHeaderBytes) > 40 && masks[3] == 0xff000000;
}

PixelForm form_of(const HeaderBytes& header, const std::string& head) {
  const auto bits = header.at<std::uint16_t>(28);
  const auto compression = header.at<std::uint32_t>(30);
  if (compression == kPlain && (bits == 1 || bits == 4 || bits == 8)) return {.bits = bits};
  if (compression == kPlain && bits == 24) return {.components = 3};
  if (compression == kPlain && bits == 32) return {.components = 4};
  if (compression == kMasked && bits == 32) {
    return {.components = 4, .has_opacity = has_opacity(header, head)};
  }
  throw_unusable("The BMP image has " + std::to_string(bits) +
                 " bits or is compressed. Images of 1, 4, 8, 24 and 32 bits without compression "
                 "are supported.");
}

}  // namespace

bool is_bmp(std::string_view head) {
  if (head.size() < kLeastHeaderBytes || !head.starts_with("BM")) return false;
  const HeaderBytes header(head, false);
  const auto size = header.at<std::uint32_t>(kFileHeaderBytes);
  return (size == 40 || size == 108 || size == 124) && header.at<std::uint16_t>(26) == 1;
}

void read_bmp(const InputFile& file, const PageCheck& check, const PageSink& sink) {
  constexpr std::size_t kLongestHeaderBytes = kFileHeaderBytes + 124;
  const std::string head = file.text(0, kLongestHeaderBytes);
  if (!is_bmp(head)) throw_unusable("The BMP header is damaged.");
  const HeaderBytes header(head, false);
  const auto width = header.at<std::int32_t>(18);
  const auto height = header.at<std::int32_t>(22);  // negative: from top to bottom
  const PixelForm form = form_of(header, head);
  if (width < 1 || height == 0 || height == INT32_MIN) {
    throw_unusable("The size of the BMP image is not plausible.");
  }
  PageLayout layout = {static_cast<std::uint32_t>(width),
                       static_cast<std::uint32_t>(std::abs(height)), StoredType::kUint8};
  if (form.components == 1) {
    layout.palette =
        palette_of(file, kFileHeaderBytes + std::uint64_t{header.at<std::uint32_t>(14)},
                   header.at<std::uint32_t>(46), form.bits);
  }
  check(layout);
  const auto offset = header.at<std::uint32_t>(10);
  const std::uint64_t row_bytes = (form.row_bytes(layout.width) + 3) / 4 * 4;
  if (file.size() < offset || (file.size() - offset) / row_bytes < layout.height) {
    throw_unusable("The BMP image is truncated.");
  }
  std::vector<std::byte> row(form.row_bytes(layout.width));
  Pixels pixels(form, layout.width);
  for (std::uint32_t y = 0; y < layout.height; ++y) {
    const std::uint64_t stored = height > 0 ? layout.height - 1 - y : y;
    file.read_exactly(offset + stored * row_bytes, row);
    sink(pixels.samples(row));
  }
}

}  // namespace isomesh::import
