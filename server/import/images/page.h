// Pages of image files: grey or indexed pictures of which several are a volume. Those of TIFF are
// in tiff.h.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <string_view>
#include <vector>

#include "base/files.h"
#include "server/import/source/source.h"

namespace isomesh::import {

using Colour = std::array<std::uint8_t, 3>;  // red, green and blue

struct PageLayout {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  StoredType type = StoredType::kUint8;
  std::vector<Colour> palette = {};  // of an indexed picture, whose samples are uint8 or uint16

  std::uint64_t bytes() const { return std::uint64_t{width} * height * bytes_per_sample(type); }
  // Palettes may differ.
  bool is_like(const PageLayout& other) const {
    return width == other.width && height == other.height && type == other.type;
  }
};

// Called with a page's layout before its samples. Throws to refuse the page.
using PageCheck = std::function<void(const PageLayout& layout)>;

// Takes the samples of a page, row by row, in the byte order of this machine.
using PageSink = std::function<void(std::span<const std::byte> samples)>;

// Windows bitmaps, .bmp: indexed ones, and those of 24 or 32 bits that are grey.
bool is_bmp(std::string_view head);
// Reads the picture from top to bottom. Throws Error kUnusableVolume, also for colours without a
// palette, and for compression.
void read_bmp(const InputFile& file, const PageCheck& check, const PageSink& sink);

// PNG images (https://www.w3.org/TR/png-3).
bool is_png(std::string_view head);
// Reads the stored samples or indices, whatever gamma the image has. Samples of fewer than 8 bits
// are not scaled. Throws Error kUnusableVolume, also for colours without a palette, opacities other
// than full ones, and interlaced images.
void read_png(const InputFile& file, const PageCheck& check, const PageSink& sink);

}  // namespace isomesh::import
