#include "server/volume/slice.h"

#include <algorithm>
#include <cmath>
#include <csetjmp>
#include <cstring>

#include <png.h>

#include "proto/error.h"
#include "proto/samples.h"
#include "server/volume/grey.h"

namespace isomesh::volume {
namespace {

constexpr std::size_t kBlockBytes = 64 * 1024;
// Samples closer together than this are read with the bytes between them.
constexpr std::size_t kCloseBytes = 4096;
constexpr std::size_t kReadBytes = std::size_t{1} << 20;
constexpr int kCompression = 3;  // higher levels take much longer for 10 % fewer bytes

struct Plane {
  std::size_t fixed;
  std::size_t column;
  std::size_t row;
};

Plane plane_of(Axis axis) {
  switch (axis) {
    case Axis::kX:
      return {0, 1, 2};
    case Axis::kY:
      return {1, 0, 2};
    case Axis::kZ:
      break;
  }
  return {2, 0, 1};
}

void append(png_struct* png, png_byte* data, std::size_t size) {
  auto* bytes = static_cast<std::string*>(png_get_io_ptr(png));
  try {
    bytes->append(reinterpret_cast<const char*>(data), size);
  } catch (...) {
    png_error(png, "out of memory");  // an exception must not pass through the library
  }
}

void flush(png_struct* /*png*/) {}

void jump(png_struct* png, const char* /*message*/) { png_longjmp(png, 1); }

void be_silent(png_struct* /*png*/, const char* /*message*/) {}

}  // namespace

// The library's state. libpng reports errors by longjmp. So each function below calls setjmp
// itself, and has no local objects with destructors, which a jump would skip.
struct SlicePng::Writer {
  explicit Writer(std::string& bytes) {
    png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, jump, be_silent);
    info = png == nullptr ? nullptr : png_create_info_struct(png);
    if (info == nullptr) {
      png_destroy_write_struct(&png, nullptr);
      throw std::bad_alloc();
    }
    png_set_write_fn(png, &bytes, append, flush);
  }
  ~Writer() { png_destroy_write_struct(&png, &info); }
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;

  bool begin(std::uint32_t width, std::uint32_t height, const std::array<double, 2>& spacing) {
    if (setjmp(png_jmpbuf(png)) != 0) return false;
    png_set_IHDR(png, info, width, height, 8, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    const double across = 1000 / spacing[0];  // pixels per metre
    const double down = 1000 / spacing[1];
    constexpr double kMost = 2147483647;
    if (std::min(across, down) >= 1 && std::max(across, down) <= kMost) {
      png_set_pHYs(png, info, static_cast<png_uint_32>(std::lround(across)),
                   static_cast<png_uint_32>(std::lround(down)), PNG_RESOLUTION_METER);
    }
    png_set_compression_level(png, kCompression);
    png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_UP);
    png_write_info(png, info);
    return true;
  }

  bool write(const std::uint8_t* row) {
    if (setjmp(png_jmpbuf(png)) != 0) return false;
    png_write_row(png, row);
    return true;
  }

  bool end() {
    if (setjmp(png_jmpbuf(png)) != 0) return false;
    png_write_end(png, nullptr);
    return true;
  }

  png_struct* png = nullptr;
  png_info* info = nullptr;
};

namespace {

void check(bool written) {
  if (!written) throw Error(ErrorCode::kInternal, "A slice could not be written as PNG.");
}

}  // namespace

std::optional<Axis> axis_of(std::string_view name) {
  if (name == "x") return Axis::kX;
  if (name == "y") return Axis::kY;
  if (name == "z") return Axis::kZ;
  return std::nullopt;
}

std::string_view to_string(Axis axis) {
  return axis == Axis::kX ? "x" : axis == Axis::kY ? "y" : "z";
}

SliceSamples::SliceSamples(std::shared_ptr<const CanonicalFile> volume, Axis axis,
                           std::uint32_t index)
    : volume_(std::move(volume)), axis_(axis), index_(index) {
  const Plane plane = plane_of(axis);
  width_ = header().dims[plane.column];
  height_ = header().dims[plane.row];
  row_.resize(row_bytes());
}

std::array<double, 2> SliceSamples::spacing() const {
  const Plane plane = plane_of(axis_);
  const auto& spacing = header().geometry.spacing;
  return {spacing[plane.column], spacing[plane.row]};
}

std::span<const std::byte> SliceSamples::row(std::uint32_t row) {
  const Plane plane = plane_of(axis_);
  const auto& dims = header().dims;
  const std::array<std::uint64_t, 3> stride = {1, dims[0], std::uint64_t{dims[0]} * dims[1]};
  const std::uint64_t first = index_ * stride[plane.fixed] + std::uint64_t{row} * stride[plane.row];
  const std::uint64_t step = stride[plane.column];
  const std::size_t size = bytes_per_sample(header().type);
  if (step == 1) {
    volume_->read(first * size, row_);
    return row_;
  }
  const std::uint64_t step_bytes = step * size;
  const std::uint64_t together = step_bytes > kCloseBytes ? 1 : kReadBytes / step_bytes;
  for (std::uint64_t begin = 0; begin < width_; begin += together) {
    const std::uint64_t count = std::min<std::uint64_t>(together, width_ - begin);
    block_.resize((count - 1) * step_bytes + size);
    volume_->read((first + begin * step) * size, block_);
    for (std::uint64_t n = 0; n < count; ++n) {
      std::memcpy(&row_[(begin + n) * size], &block_[n * step_bytes], size);
    }
  }
  return row_;
}

std::optional<std::string> SliceSamples::next() {
  if (next_row_ == height_) return std::nullopt;
  std::string bytes;
  while (next_row_ < height_ && bytes.size() < kBlockBytes) {
    const auto samples = row(next_row_++);
    bytes.append(reinterpret_cast<const char*>(samples.data()), samples.size());
  }
  return bytes;
}

SlicePng::SlicePng(std::shared_ptr<const CanonicalFile> volume, const SliceChoice& choice)
    : samples_(std::move(volume), choice.axis, choice.index),
      window_(choice.window),
      row_(samples_.width()),
      writer_(std::make_unique<Writer>(bytes_)) {
  check(writer_->begin(samples_.width(), samples_.height(), samples_.spacing()));
}

SlicePng::~SlicePng() = default;

std::optional<std::string_view> SlicePng::next() {
  bytes_.erase(0, taken_);
  if (next_row_ > samples_.height() && bytes_.empty()) return std::nullopt;
  std::size_t samples = 0;
  while (next_row_ <= samples_.height() && bytes_.size() < kBlockBytes &&
         samples < kSamplesPerPiece) {
    write_row();
    samples += samples_.width();
  }
  taken_ = bytes_.size();
  return bytes_;
}

void SlicePng::write_row() {
  if (next_row_ == samples_.height()) {
    check(writer_->end());
  } else {
    const auto bytes = samples_.row(next_row_);
    with_sample(samples_.header().type, [&](auto kind) {
      for (std::size_t column = 0; column < row_.size(); ++column) {
        auto sample = kind;
        std::memcpy(&sample, &bytes[column * sizeof(sample)], sizeof(sample));
        row_[column] = grey(static_cast<double>(sample), window_);
      }
    });
    check(writer_->write(row_.data()));
  }
  ++next_row_;
}

}  // namespace isomesh::volume
