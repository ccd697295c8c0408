#include <bit>
#include <csetjmp>
#include <cstdint>
#include <exception>
#include <new>
#include <span>
#include <string>
#include <vector>

#include <png.h>

#include "server/import/images/page.h"
#include "server/import/images/pixels.h"
#include "server/import/source/header_fields.h"
#include "server/import/source/names.h"

namespace isomesh::import {
namespace {

using std::string_view_literals::operator""sv;

constexpr std::string_view kSignature = "\x89PNG\r\n\x1a\n"sv;
constexpr std::uint32_t kMostPixels = 1U << 20;  // along each side

[[noreturn]] void throw_damaged_png() { throw_unusable("The PNG image is damaged or truncated."); }

// The file as the library reads it, and what went wrong there.
struct PngSource {
  const InputFile& file;
  std::uint64_t at = 0;
  std::exception_ptr failure;
};

// Exceptions must not pass through the library.
void read_bytes(png_struct* png, png_byte* target, std::size_t size) {
  PngSource& source = *static_cast<PngSource*>(png_get_io_ptr(png));
  std::size_t count = 0;
  try {
    count = source.file.read(source.at, std::as_writable_bytes(std::span(target, size)));
  } catch (...) {
    source.failure = std::current_exception();
  }
  source.at += count;
  if (count < size) png_error(png, "truncated");
}

void jump(png_struct* png, const char* /*message*/) { png_longjmp(png, 1); }

void be_silent(png_struct* /*png*/, const char* /*message*/) {}

// The library's state. libpng reports errors by longjmp. So each function below calls setjmp
// itself, and has no local objects with destructors, which a jump would skip.
struct PngDecoder {
  explicit PngDecoder(PngSource& source) {
    png = png_create_read_struct(PNG_LIBPNG_VER_STRING, nullptr, jump, be_silent);
    info = png == nullptr ? nullptr : png_create_info_struct(png);
    if (info == nullptr) {
      png_destroy_read_struct(&png, nullptr, nullptr);
      throw std::bad_alloc();
    }
    png_set_read_fn(png, &source, read_bytes);
    png_set_user_limits(png, kMostPixels, kMostPixels);
  }
  ~PngDecoder() { png_destroy_read_struct(&png, &info, nullptr); }
  PngDecoder(const PngDecoder&) = delete;
  PngDecoder& operator=(const PngDecoder&) = delete;

  bool begin() {
    if (setjmp(png_jmpbuf(png)) != 0) return false;
    png_read_info(png, info);
    if constexpr (std::endian::native == std::endian::little) {
      if (png_get_bit_depth(png, info) == 16) png_set_swap(png);
    }
    png_read_update_info(png, info);
    return true;
  }

  bool read(png_byte* row) {
    if (setjmp(png_jmpbuf(png)) != 0) return false;
    png_read_row(png, row, nullptr);
    return true;
  }

  bool end() {
    if (setjmp(png_jmpbuf(png)) != 0) return false;
    png_read_end(png, nullptr);
    return true;
  }

  png_struct* png = nullptr;
  png_info* info = nullptr;
};

constexpr std::uint8_t kPalette = 3;  // a type of colours, of which bits say more
constexpr std::uint8_t kColours = 2;
constexpr std::uint8_t kOpacity = 4;

PixelForm form_of(std::string_view head) {
  const auto type = static_cast<std::uint8_t>(head[25]);
  PixelForm form = {.bits = static_cast<unsigned char>(head[24])};
  form.has_opacity = (type & kOpacity) != 0;
  form.components = (type != kPalette && (type & kColours) != 0 ? 3 : 1) + form.has_opacity;
  return form;
}

PageLayout layout_of(std::string_view head, const PixelForm& form) {
  const HeaderBytes header(head, true);
  const bool is_packed = form.bits == 1 || form.bits == 2 || form.bits == 4;
  if (!is_packed && form.bits != 8 && form.bits != 16) throw_damaged_png();
  if (is_packed && form.components > 1) throw_damaged_png();
  if (head[28] != 0) {
    throw_unusable("The PNG image is interlaced, which is not supported. Save it without that.");
  }
  const PageLayout layout = {header.at<std::uint32_t>(16), header.at<std::uint32_t>(20),
                             integer_type(form)};
  if (layout.width == 0 || layout.height == 0 || layout.width > kMostPixels ||
      layout.height > kMostPixels) {
    throw_unusable("The size of the PNG image is not plausible.");
  }
  return layout;
}

std::vector<Colour> palette_of(const PngDecoder& decoder) {
  png_color* colours = nullptr;
  int count = 0;
  if (png_get_PLTE(decoder.png, decoder.info, &colours, &count) == 0) throw_damaged_png();
  std::vector<Colour> palette;
  for (const png_color& colour : std::span(colours, static_cast<std::size_t>(count))) {
    palette.push_back({colour.red, colour.green, colour.blue});
  }
  return palette;
}

}  // namespace

bool is_png(std::string_view head) {
  return head.size() >= 33 && head.starts_with(kSignature) && head.substr(12, 4) == "IHDR";
}

void read_png(const InputFile& file, const PageCheck& check, const PageSink& sink) {
  const std::string head = file.text(0, 33);
  if (!is_png(head)) throw_damaged_png();
  const PixelForm form = form_of(head);
  PageLayout layout = layout_of(head, form);
  const bool is_indexed = head[25] == kPalette;
  if (!is_indexed) check(layout);
  PngSource source = {.file = file, .at = 0, .failure = {}};
  PngDecoder reader(source);
  const auto expect = [&](bool is_read) {
    if (source.failure) std::rethrow_exception(source.failure);
    if (!is_read) throw_damaged_png();
  };
  expect(reader.begin());
  if (is_indexed) {
    layout.palette = palette_of(reader);
    check(layout);
  }
  std::vector<std::byte> row(form.row_bytes(layout.width));
  if (png_get_rowbytes(reader.png, reader.info) != row.size()) throw_damaged_png();
  Pixels pixels(form, layout.width);
  for (std::uint32_t y = 0; y < layout.height; ++y) {
    expect(reader.read(reinterpret_cast<png_byte*>(row.data())));
    sink(pixels.samples(row));
  }
  expect(reader.end());
}

}  // namespace isomesh::import
