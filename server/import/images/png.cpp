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

PageLayout layout_of(std::string_view head) {
  const HeaderBytes header(head, true);
  const auto bits = static_cast<unsigned char>(head[24]);
  if (head[25] != 0) {
    throw_unusable("The PNG image has colours, a palette or transparency. Only grey is supported.");
  }
  if ((bits != 8 && bits != 16) || head[28] != 0) {
    throw_unusable("The PNG image has " + std::to_string(bits) +
                   " bits or is interlaced. 8 and 16 bits, not interlaced, are supported.");
  }
  const PageLayout layout = {header.at<std::uint32_t>(16), header.at<std::uint32_t>(20),
                             bits == 8 ? StoredType::kUint8 : StoredType::kUint16};
  if (layout.width == 0 || layout.height == 0 || layout.width > kMostPixels ||
      layout.height > kMostPixels) {
    throw_unusable("The size of the PNG image is not plausible.");
  }
  return layout;
}

}  // namespace

bool is_png(std::string_view head) {
  return head.size() >= 33 && head.starts_with(kSignature) && head.substr(12, 4) == "IHDR";
}

void read_png(const InputFile& file, const PageCheck& check, const PageSink& sink) {
  const std::string head = file.text(0, 33);
  if (!is_png(head)) throw_damaged_png();
  const PageLayout layout = layout_of(head);
  check(layout);
  PngSource source = {.file = file, .at = 0, .failure = {}};
  PngDecoder reader(source);
  const auto expect = [&](bool is_read) {
    if (source.failure) std::rethrow_exception(source.failure);
    if (!is_read) throw_damaged_png();
  };
  expect(reader.begin());
  std::vector<png_byte> row(layout.width * bytes_per_sample(layout.type));
  if (png_get_rowbytes(reader.png, reader.info) != row.size()) throw_damaged_png();
  for (std::uint32_t y = 0; y < layout.height; ++y) {
    expect(reader.read(row.data()));
    sink(std::as_bytes(std::span(row)));
  }
  expect(reader.end());
}

}  // namespace isomesh::import
