// Pages of image files: grey pictures of which several are a volume. Those of TIFF are in tiff.h.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string_view>

#include "base/files.h"
#include "server/import/source/source.h"

namespace isomesh::import {

struct PageLayout {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  StoredType type = StoredType::kUint8;

  std::uint64_t bytes() const { return std::uint64_t{width} * height * bytes_per_sample(type); }
  bool operator==(const PageLayout&) const = default;
};

// Called with a page's layout before its samples. Throws to refuse the page.
using PageCheck = std::function<void(const PageLayout& layout)>;

// Takes the samples of a page, row by row, in the byte order of this machine.
using PageSink = std::function<void(std::span<const std::byte> samples)>;

// Windows bitmaps, .bmp, of grey samples of 8 bits.
bool is_bmp(std::string_view head);
// Reads the picture from top to bottom. Throws Error kUnusableVolume, also for colours and
// compression.
void read_bmp(const InputFile& file, const PageCheck& check, const PageSink& sink);

// PNG images of grey samples (https://www.w3.org/TR/png-3).
bool is_png(std::string_view head);
// Reads the stored samples, whatever gamma the image has. Throws Error kUnusableVolume, also for
// colours, transparency, fewer than 8 bits and interlaced images.
void read_png(const InputFile& file, const PageCheck& check, const PageSink& sink);

}  // namespace isomesh::import
