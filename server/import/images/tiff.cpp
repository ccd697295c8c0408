#include "server/import/images/tiff.h"

#include <algorithm>
#include <cstring>
#include <optional>
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
  throw_unusable("The TIFF image's samples are " +
                 std::string(format == SAMPLEFORMAT_IEEEFP ? "floats of " : "of ") +
                 std::to_string(bits) +
                 " bits, which is not supported. Integers of 8, 16 and 32 bits, and floats of 32 "
                 "and 64 bits are.");
}

PageLayout layout_of(TIFF* tiff) {
  const auto photometric = field<std::uint16_t>(tiff, TIFFTAG_PHOTOMETRIC);
  const auto components = field<std::uint16_t>(tiff, TIFFTAG_SAMPLESPERPIXEL);
  if (components != 1 &&
      field<std::uint16_t>(tiff, TIFFTAG_PLANARCONFIG) == PLANARCONFIG_SEPARATE) {
    throw_unusable(
        "The TIFF image has several channels in a page, which is not supported. Save "
        "one channel, or each as pages of its own.");
  }
  if (components != 1 ||
      (photometric != PHOTOMETRIC_MINISBLACK && photometric != PHOTOMETRIC_MINISWHITE)) {
    throw_unusable("The TIFF image has colours or a palette. Only grey images are supported.");
  }
  if (field<std::uint32_t>(tiff, TIFFTAG_IMAGEDEPTH) > 1) {
    throw_unusable(
        "The TIFF image has several planes in a page (ImageDepth), which is not "
        "supported. Save each plane as a page.");
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

// The corner with the first row and column.
struct Corner {
  bool is_bottom = false;
  bool is_right = false;
  bool operator==(const Corner&) const = default;
};

Corner corner_of(TIFF* tiff) {
  const auto orientation = field<std::uint16_t>(tiff, TIFFTAG_ORIENTATION);
  const Corner corner = {
      .is_bottom = orientation == ORIENTATION_BOTLEFT || orientation == ORIENTATION_BOTRIGHT,
      .is_right = orientation == ORIENTATION_TOPRIGHT || orientation == ORIENTATION_BOTRIGHT};
  if (orientation == ORIENTATION_TOPLEFT || corner != Corner{}) return corner;
  throw_unusable("The TIFF image's orientation " + std::to_string(orientation) +
                 " exchanges rows and columns, which is not supported.");
}

// Turns the rows of a block of them so that they begin at the top left.
void turn(std::span<std::byte> rows, const PageLayout& layout, const Corner& corner) {
  const std::uint64_t row_bytes = layout.bytes() / layout.height;
  const std::uint64_t count = rows.size() / row_bytes;
  for (std::uint64_t row = 0; corner.is_bottom && row < count / 2; ++row) {
    std::ranges::swap_ranges(rows.subspan(row * row_bytes, row_bytes),
                             rows.subspan((count - 1 - row) * row_bytes, row_bytes));
  }
  if (!corner.is_right) return;
  with_stored_sample(layout.type, [&](auto sample) {
    using Sample = decltype(sample);
    for (std::uint64_t row = 0; row < count; ++row) {
      auto* first = reinterpret_cast<Sample*>(rows.data() + row * row_bytes);
      std::reverse(first, first + layout.width);
    }
  });
}

void read_strips(TIFF* tiff, const PageLayout& layout, const Corner& corner, const PageSink& sink) {
  check_block(TIFFStripSize64(tiff));
  std::vector<std::byte> strip(TIFFStripSize64(tiff));
  const std::uint64_t strips = (layout.bytes() + strip.size() - 1) / strip.size();
  if (strips > TIFFNumberOfStrips(tiff)) throw_damaged_tiff();
  for (std::uint64_t next = 0; next < strips; ++next) {
    const std::uint64_t at = corner.is_bottom ? strips - 1 - next : next;
    const std::span rows =
        std::span(strip).first(std::min(layout.bytes() - at * strip.size(), strip.size()));
    const auto size = static_cast<tmsize_t>(rows.size());
    if (TIFFReadEncodedStrip(tiff, static_cast<std::uint32_t>(at), rows.data(), size) != size) {
      throw_damaged_tiff();
    }
    turn(rows, layout, corner);
    sink(rows);
  }
}

void read_tiles(TIFF* tiff, const PageLayout& layout, const Corner& corner, const PageSink& sink) {
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
  const std::uint32_t bands = layout.height / height + (layout.height % height > 0 ? 1 : 0);
  for (std::uint32_t next = 0; next < bands; ++next) {
    const std::uint32_t y = (corner.is_bottom ? bands - 1 - next : next) * height;
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
    const std::span band =
        std::span(rows).first(std::min<std::uint64_t>(height, layout.height - y) * row_bytes);
    turn(band, layout, corner);
    sink(band);
  }
}

}  // namespace

class TiffFile::Library {
 public:
  explicit Library(const InputFile& file) : position_{file}, tiff_(open(position_)) {}
  ~Library() { TIFFClose(tiff_); }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;

  TIFF* tiff() const { return tiff_; }

  std::string_view description() const {
    const char* text = nullptr;
    return TIFFGetField(tiff_, TIFFTAG_IMAGEDESCRIPTION, &text) == 1 ? text : "";
  }

  // Empty unless the file is of a Zeiss LSM.
  std::string_view lsm_information() const {
    constexpr std::uint32_t kInformation = 34412;
    std::uint32_t count = 0;
    const char* bytes = nullptr;
    if (TIFFGetField(tiff_, kInformation, &count, &bytes) != 1) return {};
    return {bytes, count};
  }

  void check_corner(const Corner& corner) {
    if (first_corner_.value_or(corner) != corner) {
      throw_unusable("The pages of the TIFF differ in their orientation.");
    }
    first_corner_ = corner;
  }

  // Before anything else.
  void count() {
    std::uint64_t offset = 0;
    do {
      offset = TIFFCurrentDirOffset(tiff_);
      if (is_reduced()) continue;
      if (offsets_.size() == kMostPages) {
        throw_unusable("The TIFF file has more than a million pages.");
      }
      offsets_.push_back(offset);
    } while (TIFFReadDirectory(tiff_) == 1);
    if (offsets_.empty()) offsets_.push_back(offset);
    page_ = offsets_.size();
    go_to(0);
    if (offsets_.size() == 1) planes_ = planes_behind();
  }

  void go_to(std::uint64_t page) {
    if (page == page_) return;
    if (TIFFSetSubDirectory(tiff_, offsets_.at(page)) != 1) throw_damaged_tiff();
    page_ = page;
  }

  std::uint64_t pages() const { return std::max<std::uint64_t>(offsets_.size(), planes_); }

  bool has_planes() const { return planes_ > 1; }

  // `page` is below pages().
  void read_plane(std::uint64_t page, const PageLayout& layout, const PageSink& sink) const {
    std::vector<std::byte> piece(std::min<std::uint64_t>(kPieceBytes, layout.bytes()));
    const std::uint64_t begin = TIFFGetStrileOffset(tiff_, 0) + page * layout.bytes();
    for (std::uint64_t at = 0; at < layout.bytes(); at += piece.size()) {
      piece.resize(std::min<std::uint64_t>(piece.size(), layout.bytes() - at));
      if (position_.file.read(begin + at, piece) != piece.size()) throw_damaged_tiff();
      if (TIFFIsByteSwapped(tiff_) != 0) swap_bytes(piece, bytes_per_sample(layout.type));
      sink(piece);
    }
  }

 private:
  // ImageJ stores large stacks with one page only, and the other planes behind its own. So does
  // tifffile if it is asked to.
  std::uint64_t planes_behind() const {
    const std::uint64_t images = images_behind_page(description());
    if (images <= 1 || TIFFIsTiled(tiff_) != 0 || corner_of(tiff_) != Corner{} ||
        field<std::uint16_t>(tiff_, TIFFTAG_COMPRESSION) != COMPRESSION_NONE) {
      return 0;
    }
    for (std::uint32_t strip = 1; strip < TIFFNumberOfStrips(tiff_); ++strip) {
      const std::uint64_t end =
          TIFFGetStrileOffset(tiff_, strip - 1) + TIFFGetStrileByteCount(tiff_, strip - 1);
      if (TIFFGetStrileOffset(tiff_, strip) != end) return 0;
    }
    const std::uint64_t begin = TIFFGetStrileOffset(tiff_, 0);
    const std::uint64_t size = position_.file.size();
    return begin < size && images <= (size - begin) / layout_of(tiff_).bytes() ? images : 0;
  }

  bool is_reduced() const {
    return (field<std::uint32_t>(tiff_, TIFFTAG_SUBFILETYPE) & FILETYPE_REDUCEDIMAGE) != 0;
  }

  TiffPosition position_;
  TIFF* tiff_;
  std::uint64_t page_ = 0;
  std::vector<std::uint64_t> offsets_;  // of the pages' directories
  std::uint64_t planes_ = 0;            // behind each other with one page only; 0 without them
  std::optional<Corner> first_corner_;
};

bool is_tiff(std::string_view head) {
  return head.starts_with("II*\0"sv) || head.starts_with("MM\0*"sv) ||
         head.starts_with("II+\0\x08\0"sv) || head.starts_with("MM\0+\0\x08"sv);
}

TiffFile::TiffFile(const InputFile& file) : library_(std::make_unique<Library>(file)) {
  library_->count();
}
TiffFile::~TiffFile() = default;

std::uint64_t TiffFile::pages() { return library_->pages(); }

TiffMeaning TiffFile::meaning() {
  library_->go_to(0);
  const TiffResolution resolution = {field<float>(library_->tiff(), TIFFTAG_XRESOLUTION),
                                     field<float>(library_->tiff(), TIFFTAG_YRESOLUTION)};
  if (auto meaning = lsm_meaning(library_->lsm_information())) return *meaning;
  return tiff_meaning(library_->description(), resolution, pages());
}

void TiffFile::read(std::uint64_t page, const PageCheck& check, const PageSink& sink) {
  library_->go_to(library_->has_planes() ? 0 : page);
  TIFF* tiff = library_->tiff();
  check_compression(tiff);
  const PageLayout layout = layout_of(tiff);
  const Corner corner = corner_of(tiff);
  library_->check_corner(corner);
  check(layout);
  if (library_->has_planes()) {
    library_->read_plane(page, layout, sink);
  } else if (TIFFIsTiled(tiff) != 0) {
    read_tiles(tiff, layout, corner, sink);
  } else {
    read_strips(tiff, layout, corner, sink);
  }
}

}  // namespace isomesh::import
