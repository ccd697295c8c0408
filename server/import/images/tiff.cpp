#include "server/import/images/tiff.h"

#include <algorithm>
#include <cstring>
#include <vector>

#include <tiffio.h>

#include "server/import/source/names.h"

namespace isomesh::import {

struct TiffPosition {
  const InputFile& file;
  std::uint64_t at = 0;
};

namespace {

using std::string_view_literals::operator""sv;

constexpr std::uint64_t kMostPages = 1'000'000;
// The limit for one strip or one row of tiles.
constexpr std::uint64_t kMostBlockBytes = std::uint64_t{256} << 20;

[[noreturn]] void throw_damaged_tiff() {
  throw_unusable("The TIFF image is damaged or truncated.");
}

// --- Access to the file --------------------------------------------------------------------------

TiffPosition& position_of(thandle_t handle) { return *static_cast<TiffPosition*>(handle); }

tmsize_t read_bytes(thandle_t handle, void* target, tmsize_t size) {
  TiffPosition& position = position_of(handle);
  const std::span<std::byte> bytes(static_cast<std::byte*>(target), static_cast<std::size_t>(size));
  const std::size_t count = position.file.read(position.at, bytes);
  position.at += count;
  return static_cast<tmsize_t>(count);
}

tmsize_t write_bytes(thandle_t, void*, tmsize_t) { return 0; }

toff_t seek(thandle_t handle, toff_t offset, int whence) {
  TiffPosition& position = position_of(handle);
  if (whence == SEEK_SET) position.at = offset;
  if (whence == SEEK_CUR) position.at += offset;
  if (whence == SEEK_END) position.at = position.file.size() + offset;
  return position.at;
}

int close_nothing(thandle_t) { return 0; }

toff_t size_of(thandle_t handle) { return position_of(handle).file.size(); }

// Its messages would go to standard error.
int ignore(TIFF*, void*, const char*, const char*, va_list) { return 1; }

TIFF* open(TiffPosition& position) {
  TIFFOpenOptions* options = TIFFOpenOptionsAlloc();
  if (options == nullptr) throw std::bad_alloc();
  TIFFOpenOptionsSetMaxSingleMemAlloc(options, kMostBlockBytes);
  TIFFOpenOptionsSetErrorHandlerExtR(options, ignore, nullptr);
  TIFFOpenOptionsSetWarningHandlerExtR(options, ignore, nullptr);
  TIFF* tiff = TIFFClientOpenExt("", "rm", &position, read_bytes, write_bytes, seek, close_nothing,
                                 size_of, nullptr, nullptr, options);
  TIFFOpenOptionsFree(options);
  if (tiff == nullptr) throw_damaged_tiff();
  return tiff;
}

// --- Pages ---------------------------------------------------------------------------------------

template <class Value>
Value field(TIFF* tiff, std::uint32_t tag) {
  Value value = {};
  if (TIFFGetFieldDefaulted(tiff, tag, &value) != 1) return {};
  return value;
}

void check_compression(TIFF* tiff) {
  static constexpr std::uint16_t kLossless[] = {
      COMPRESSION_NONE,     COMPRESSION_LZW,  COMPRESSION_ADOBE_DEFLATE, COMPRESSION_DEFLATE,
      COMPRESSION_PACKBITS, COMPRESSION_LZMA, COMPRESSION_ZSTD};
  const auto found = field<std::uint16_t>(tiff, TIFFTAG_COMPRESSION);
  const bool is_lossless = std::ranges::find(kLossless, found) != std::end(kLossless);
  if (is_lossless && TIFFIsCODECConfigured(found) != 0) return;
  throw_unusable("The TIFF image's compression " + std::to_string(found) +
                 " is not supported. LZW, deflate, PackBits, LZMA and Zstandard are.");
}

StoredType type_of(TIFF* tiff) {
  const auto bits = field<std::uint16_t>(tiff, TIFFTAG_BITSPERSAMPLE);
  const auto format = field<std::uint16_t>(tiff, TIFFTAG_SAMPLEFORMAT);
  if (format == SAMPLEFORMAT_IEEEFP && bits == 32) return StoredType::kFloat32;
  if (format == SAMPLEFORMAT_IEEEFP && bits == 64) return StoredType::kFloat64;
  const bool is_signed = format == SAMPLEFORMAT_INT;
  if (is_signed || format == SAMPLEFORMAT_UINT || format == SAMPLEFORMAT_VOID) {
    if (bits == 8) return is_signed ? StoredType::kInt8 : StoredType::kUint8;
    if (bits == 16) return is_signed ? StoredType::kInt16 : StoredType::kUint16;
    if (bits == 32) return is_signed ? StoredType::kInt32 : StoredType::kUint32;
  }
  throw_unusable("The TIFF image's samples of " + std::to_string(bits) +
                 " bits are not supported. 8, 16 and 32 bits, and floats of 32 and 64 are.");
}

PageLayout layout_of(TIFF* tiff) {
  const auto photometric = field<std::uint16_t>(tiff, TIFFTAG_PHOTOMETRIC);
  const auto components = field<std::uint16_t>(tiff, TIFFTAG_SAMPLESPERPIXEL);
  if (components != 1 ||
      (photometric != PHOTOMETRIC_MINISBLACK && photometric != PHOTOMETRIC_MINISWHITE)) {
    throw_unusable("The TIFF image has colours or a palette. Only grey images are supported.");
  }
  const PageLayout layout = {field<std::uint32_t>(tiff, TIFFTAG_IMAGEWIDTH),
                             field<std::uint32_t>(tiff, TIFFTAG_IMAGELENGTH), type_of(tiff)};
  if (layout.width == 0 || layout.height == 0) throw_damaged_tiff();
  return layout;
}

void check_block(std::uint64_t bytes) {
  if (bytes == 0) throw_damaged_tiff();
  if (bytes <= kMostBlockBytes) return;
  throw_unusable("The TIFF image's strips or rows of tiles are larger than 256 MiB.");
}

void read_strips(TIFF* tiff, const PageLayout& layout, const PageSink& sink) {
  check_block(TIFFStripSize64(tiff));
  std::vector<std::byte> strip(TIFFStripSize64(tiff));
  std::uint64_t left = layout.bytes();
  for (std::uint32_t at = 0; left > 0; ++at) {
    if (at >= TIFFNumberOfStrips(tiff)) throw_damaged_tiff();
    const std::size_t wanted = std::min<std::uint64_t>(left, strip.size());
    const auto size = static_cast<tmsize_t>(wanted);
    if (TIFFReadEncodedStrip(tiff, at, strip.data(), size) != size) throw_damaged_tiff();
    sink(std::span(strip).first(wanted));
    left -= wanted;
  }
}

void read_tiles(TIFF* tiff, const PageLayout& layout, const PageSink& sink) {
  const auto width = field<std::uint32_t>(tiff, TIFFTAG_TILEWIDTH);
  const auto height = field<std::uint32_t>(tiff, TIFFTAG_TILELENGTH);
  const std::uint64_t row_bytes = layout.bytes() / layout.height;
  const std::uint64_t tile_row = std::uint64_t{width} * bytes_per_sample(layout.type);
  check_block(TIFFTileSize64(tiff));
  check_block(row_bytes);
  if (height > kMostBlockBytes / row_bytes) check_block(kMostBlockBytes + 1);
  if (TIFFTileSize64(tiff) != tile_row * height) throw_damaged_tiff();
  std::vector<std::byte> tile(TIFFTileSize64(tiff));
  std::vector<std::byte> rows(row_bytes * height);
  for (std::uint32_t y = 0; y < layout.height; y += std::min(height, layout.height - y)) {
    for (std::uint64_t x = 0; x < layout.width; x += width) {
      const std::uint32_t at = TIFFComputeTile(tiff, static_cast<std::uint32_t>(x), y, 0, 0);
      const auto size = static_cast<tmsize_t>(tile.size());
      if (TIFFReadEncodedTile(tiff, at, tile.data(), size) != size) throw_damaged_tiff();
      const std::uint64_t begin = x * bytes_per_sample(layout.type);
      const std::uint64_t count = std::min(tile_row, row_bytes - begin);
      for (std::uint64_t row = 0; row < height; ++row) {
        std::memcpy(rows.data() + row * row_bytes + begin, tile.data() + row * tile_row, count);
      }
    }
    sink(std::span(rows).first(std::min<std::uint64_t>(height, layout.height - y) * row_bytes));
  }
}

}  // namespace

class TiffFile::Library {
 public:
  explicit Library(const InputFile& file) : position_{file}, tiff_(open(position_)) {
    if (is_reduced()) step();
  }
  ~Library() { TIFFClose(tiff_); }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;

  TIFF* tiff() const { return tiff_; }

  void go_to(std::uint64_t page) {
    if (page < page_) rewind();
    while (page_ < page) {
      if (!step()) throw_damaged_tiff();
      ++page_;
    }
  }

  std::uint64_t count() {
    rewind();
    std::uint64_t pages = 1;
    while (step()) {
      if (++pages > kMostPages) throw_unusable("The TIFF file has more than a million pages.");
    }
    rewind();
    return pages;
  }

 private:
  bool is_reduced() const {
    return (field<std::uint32_t>(tiff_, TIFFTAG_SUBFILETYPE) & FILETYPE_REDUCEDIMAGE) != 0;
  }

  // The next page that is no reduced copy.
  bool step() {
    while (TIFFReadDirectory(tiff_) == 1) {
      if (!is_reduced()) return true;
    }
    return false;
  }

  void rewind() {
    if (TIFFSetDirectory(tiff_, 0) != 1) throw_damaged_tiff();
    if (is_reduced()) step();
    page_ = 0;
  }

  TiffPosition position_;
  TIFF* tiff_;
  std::uint64_t page_ = 0;
};

bool is_tiff(std::string_view head) {
  return head.starts_with("II*\0"sv) || head.starts_with("MM\0*"sv) ||
         head.starts_with("II+\0\x08\0"sv) || head.starts_with("MM\0+\0\x08"sv);
}

TiffFile::TiffFile(const InputFile& file) : library_(std::make_unique<Library>(file)) {}
TiffFile::~TiffFile() = default;

std::uint64_t TiffFile::pages() { return library_->count(); }

TiffMeaning TiffFile::meaning() {
  const std::uint64_t count = pages();
  const char* description = nullptr;
  if (TIFFGetField(library_->tiff(), TIFFTAG_IMAGEDESCRIPTION, &description) != 1) {
    description = "";
  }
  const TiffResolution resolution = {field<float>(library_->tiff(), TIFFTAG_XRESOLUTION),
                                     field<float>(library_->tiff(), TIFFTAG_YRESOLUTION)};
  return tiff_meaning(description, resolution, count);
}

void TiffFile::read(std::uint64_t page, const PageCheck& check, const PageSink& sink) {
  library_->go_to(page);
  TIFF* tiff = library_->tiff();
  check_compression(tiff);
  const PageLayout layout = layout_of(tiff);
  check(layout);
  if (TIFFIsTiled(tiff) != 0) {
    read_tiles(tiff, layout, sink);
  } else {
    read_strips(tiff, layout, sink);
  }
}

}  // namespace isomesh::import
