#include "server/import/images/tiff.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <vector>

#include <tiffio.h>

#include "server/import/images/pixels.h"
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
      COMPRESSION_NONE,      COMPRESSION_LZW,      COMPRESSION_ADOBE_DEFLATE, COMPRESSION_DEFLATE,
      COMPRESSION_PACKBITS,  COMPRESSION_LZMA,     COMPRESSION_ZSTD,          COMPRESSION_CCITTRLE,
      COMPRESSION_CCITTFAX3, COMPRESSION_CCITTFAX4};
  const auto found = field<std::uint16_t>(tiff, TIFFTAG_COMPRESSION);
  const bool is_lossless = std::ranges::find(kLossless, found) != std::end(kLossless);
  if (is_lossless && TIFFIsCODECConfigured(found) != 0) return;
  throw_unusable("The TIFF image's compression " + std::to_string(found) +
                 " is not supported. LZW, deflate, PackBits, LZMA, Zstandard and those of fax "
                 "are.");
}

// Colours with or without an opacity, or grey with one.
void set_components(TIFF* tiff, PixelForm& form) {
  const auto photometric = field<std::uint16_t>(tiff, TIFFTAG_PHOTOMETRIC);
  form.components = field<std::uint16_t>(tiff, TIFFTAG_SAMPLESPERPIXEL);
  std::uint16_t count = 0;
  const std::uint16_t* kinds = nullptr;
  const bool has_kinds = TIFFGetField(tiff, TIFFTAG_EXTRASAMPLES, &count, &kinds) == 1;
  form.has_opacity = has_kinds && count == 1 && kinds[0] != EXTRASAMPLE_UNSPECIFIED;
  const bool is_grey =
      photometric == PHOTOMETRIC_MINISBLACK || photometric == PHOTOMETRIC_MINISWHITE;
  const unsigned colours = photometric == PHOTOMETRIC_RGB ? 3 : 1;
  if (!is_grey && photometric != PHOTOMETRIC_PALETTE && photometric != PHOTOMETRIC_RGB) {
    throw_coloured();
  }
  if (form.components == 1 && colours == 1) return;
  const bool has_rest = form.components == colours + (form.has_opacity ? 1 : 0);
  const bool is_separate =
      field<std::uint16_t>(tiff, TIFFTAG_PLANARCONFIG) == PLANARCONFIG_SEPARATE;
  if (!has_rest || is_separate || photometric == PHOTOMETRIC_PALETTE) {
    throw_unusable(
        "The TIFF image has several channels in a page, which is not supported. Save one channel, "
        "or each as pages of its own.");
  }
}

// Throws unless the samples are of one of these kinds.
void check_type(std::uint16_t format, const PixelForm& form) {
  const unsigned bits = form.bits;
  const bool is_float = format == SAMPLEFORMAT_IEEEFP;
  const bool is_packed = format != SAMPLEFORMAT_INT && (bits == 1 || bits == 2 || bits == 4);
  const bool is_whole = bits == 8 || bits == 16;
  const bool is_wide = bits == 32 || bits == 64;
  const bool is_known = is_float || format == SAMPLEFORMAT_INT || format == SAMPLEFORMAT_UINT ||
                        format == SAMPLEFORMAT_VOID;
  const bool is_possible = form.components > 1 ? is_whole && !is_float
                           : is_float          ? bits == 16 || is_wide
                                               : is_packed || is_whole || is_wide;
  if (is_known && is_possible) return;
  throw_unusable("The TIFF image's samples are " + std::string(is_float ? "floats of " : "of ") +
                 std::to_string(bits) +
                 " bits, which is not supported. Integers of 1, 2, 4, 8, 16, 32 and 64 bits, and "
                 "floats of 16, 32 and 64 bits are.");
}

PixelForm form_of(TIFF* tiff) {
  const auto format = field<std::uint16_t>(tiff, TIFFTAG_SAMPLEFORMAT);
  PixelForm form = {.bits = field<std::uint16_t>(tiff, TIFFTAG_BITSPERSAMPLE)};
  set_components(tiff, form);
  check_type(format, form);
  form.is_half = format == SAMPLEFORMAT_IEEEFP && form.bits == 16;
  return form;
}

StoredType type_of(TIFF* tiff, const PixelForm& form) {
  const auto format = field<std::uint16_t>(tiff, TIFFTAG_SAMPLEFORMAT);
  if (format == SAMPLEFORMAT_IEEEFP) {
    return form.bits == 64 ? StoredType::kFloat64 : StoredType::kFloat32;
  }
  const bool is_signed = format == SAMPLEFORMAT_INT;
  if (form.bits == 64) return is_signed ? StoredType::kInt64 : StoredType::kUint64;
  if (form.bits == 32) return is_signed ? StoredType::kInt32 : StoredType::kUint32;
  if (form.bits == 16) return is_signed ? StoredType::kInt16 : StoredType::kUint16;
  return is_signed ? StoredType::kInt8 : StoredType::kUint8;
}

// The colours have 16 bits; some programs write 8.
std::vector<Colour> palette_of(TIFF* tiff, const PixelForm& form) {
  const StoredType type = type_of(tiff, form);
  if (type != StoredType::kUint8 && type != StoredType::kUint16) {
    throw_unusable(
        "The TIFF image has a palette, but its samples are no indices: they are signed, floats, "
        "or of more than 16 bits. Save them as a grey picture.");
  }
  std::array<std::uint16_t*, 3> parts = {};
  if (TIFFGetField(tiff, TIFFTAG_COLORMAP, &parts[0], &parts[1], &parts[2]) != 1) {
    throw_damaged_tiff();
  }
  const std::size_t count = std::size_t{1} << form.bits;
  const bool is_narrow = std::ranges::all_of(parts, [&](const std::uint16_t* part) {
    return std::all_of(part, part + count, [](std::uint16_t value) { return value < 256; });
  });
  std::vector<Colour> palette(count);
  for (std::size_t at = 0; at < count; ++at) {
    for (std::size_t part = 0; part < 3; ++part) {
      palette[at][part] = static_cast<std::uint8_t>(parts[part][at] >> (is_narrow ? 0 : 8));
    }
  }
  return palette;
}

PageLayout layout_of(TIFF* tiff, const PixelForm& form) {
  if (field<std::uint32_t>(tiff, TIFFTAG_IMAGEDEPTH) > 1) {
    throw_unusable(
        "The TIFF image has several planes in a page (ImageDepth), which is not "
        "supported. Save each plane as a page.");
  }
  PageLayout layout = {field<std::uint32_t>(tiff, TIFFTAG_IMAGEWIDTH),
                       field<std::uint32_t>(tiff, TIFFTAG_IMAGELENGTH), type_of(tiff, form)};
  if (layout.width == 0 || layout.height == 0) throw_damaged_tiff();
  if (field<std::uint16_t>(tiff, TIFFTAG_PHOTOMETRIC) == PHOTOMETRIC_PALETTE) {
    layout.palette = palette_of(tiff, form);
  }
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

// Checks a strip or row of tiles as the library decodes it, and as samples.
void check_blocks(std::uint64_t bytes, std::uint64_t rows, const PageLayout& layout) {
  check_block(bytes);
  check_block(layout.bytes() / layout.height);
  if (rows > kMostBlockBytes / (layout.bytes() / layout.height)) check_block(kMostBlockBytes + 1);
}

void read_strips(TIFF* tiff, const PixelForm& form, const PageLayout& layout, const Corner& corner,
                 const PageSink& sink) {
  const std::uint64_t row_bytes = form.row_bytes(layout.width);
  std::vector<std::byte> strip;
  const std::uint64_t strip_bytes = TIFFStripSize64(tiff);
  check_blocks(strip_bytes, strip_bytes / row_bytes, layout);
  if (strip_bytes % row_bytes != 0) throw_damaged_tiff();
  strip.resize(strip_bytes);
  const std::uint64_t bytes = row_bytes * layout.height;
  const std::uint64_t strips = (bytes + strip_bytes - 1) / strip_bytes;
  if (strips > TIFFNumberOfStrips(tiff)) throw_damaged_tiff();
  Pixels pixels(form, layout.width);
  for (std::uint64_t next = 0; next < strips; ++next) {
    const std::uint64_t at = corner.is_bottom ? strips - 1 - next : next;
    const std::span stored =
        std::span(strip).first(std::min(bytes - at * strip_bytes, strip_bytes));
    const auto size = static_cast<tmsize_t>(stored.size());
    if (TIFFReadEncodedStrip(tiff, static_cast<std::uint32_t>(at), stored.data(), size) != size) {
      throw_damaged_tiff();
    }
    const std::span rows = pixels.samples(stored);
    turn(rows, layout, corner);
    sink(rows);
  }
}

void read_tiles(TIFF* tiff, const PixelForm& form, const PageLayout& layout, const Corner& corner,
                const PageSink& sink) {
  const auto width = field<std::uint32_t>(tiff, TIFFTAG_TILEWIDTH);
  const auto height = field<std::uint32_t>(tiff, TIFFTAG_TILELENGTH);
  const std::uint64_t row_bytes = layout.bytes() / layout.height;
  const std::uint64_t tile_row = std::uint64_t{width} * bytes_per_sample(layout.type);
  check_blocks(TIFFTileSize64(tiff), height, layout);
  if (TIFFTileSize64(tiff) != form.row_bytes(width) * height) throw_damaged_tiff();
  check_block(tile_row);
  if (height > kMostBlockBytes / tile_row) check_block(kMostBlockBytes + 1);
  std::vector<std::byte> stored(TIFFTileSize64(tiff));
  std::vector<std::byte> rows(row_bytes * height);
  Pixels pixels(form, width);
  const std::uint32_t bands = layout.height / height + (layout.height % height > 0 ? 1 : 0);
  for (std::uint32_t next = 0; next < bands; ++next) {
    const std::uint32_t y = (corner.is_bottom ? bands - 1 - next : next) * height;
    const auto band_rows = std::min<std::uint64_t>(height, layout.height - y);
    for (std::uint64_t x = 0; x < layout.width; x += width) {
      const std::uint32_t at = TIFFComputeTile(tiff, static_cast<std::uint32_t>(x), y, 0, 0);
      const auto size = static_cast<tmsize_t>(stored.size());
      if (TIFFReadEncodedTile(tiff, at, stored.data(), size) != size) throw_damaged_tiff();
      const std::span tile = pixels.samples(stored);
      const std::uint64_t begin = x * bytes_per_sample(layout.type);
      const std::uint64_t count = std::min(tile_row, row_bytes - begin);
      for (std::uint64_t row = 0; row < band_rows; ++row) {
        std::memcpy(rows.data() + row * row_bytes + begin, tile.data() + row * tile_row, count);
      }
    }
    const std::span band = std::span(rows).first(band_rows * row_bytes);
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
  void read_plane(std::uint64_t page, const PixelForm& form, const PageLayout& layout,
                  const PageSink& sink) const {
    const std::uint64_t row_bytes = form.row_bytes(layout.width);
    check_block(row_bytes);
    std::vector<std::byte> row(row_bytes);
    Pixels pixels(form, layout.width);
    const std::uint64_t begin = TIFFGetStrileOffset(tiff_, 0) + page * row_bytes * layout.height;
    for (std::uint64_t y = 0; y < layout.height; ++y) {
      if (position_.file.read(begin + y * row_bytes, row) != row.size()) throw_damaged_tiff();
      if (TIFFIsByteSwapped(tiff_) != 0 && form.bits > 8) swap_bytes(row, form.bits / 8);
      sink(pixels.samples(row));
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
    const PixelForm form = form_of(tiff_);
    const PageLayout layout = layout_of(tiff_, form);
    return begin < size && images <= (size - begin) / form.row_bytes(layout.width) / layout.height
               ? images
               : 0;
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
  const PixelForm form = form_of(tiff);
  const PageLayout layout = layout_of(tiff, form);
  const Corner corner = corner_of(tiff);
  library_->check_corner(corner);
  check(layout);
  if (library_->has_planes()) {
    library_->read_plane(page, form, layout, sink);
  } else if (TIFFIsTiled(tiff) != 0) {
    read_tiles(tiff, form, layout, corner, sink);
  } else {
    read_strips(tiff, form, layout, corner, sink);
  }
}

}  // namespace isomesh::import
