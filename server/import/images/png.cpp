#include "server/import/images/png.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include <zlib.h>

#include "server/import/source/header_bytes.h"
#include "server/import/source/names.h"

namespace isomesh::import {
namespace {

using std::string_view_literals::operator""sv;

constexpr std::string_view kMagic = "\x89PNG\r\n\x1a\n"sv;
constexpr std::size_t kPieceBytes = std::size_t{1} << 16;

[[noreturn]] void throw_damaged_png() { throw_unusable("The PNG image is damaged or truncated."); }

// The content of all IDAT chunks, in order.
class ImageData {
 public:
  explicit ImageData(const InputFile& file) : file_(file) {}

  // The next bytes; empty at the end.
  std::string next() {
    while (left_ == 0) {
      const std::string head = file_.text(at_, 8);
      if (head.size() < 8) throw_damaged_png();
      const auto size = HeaderBytes(head, true).at<std::uint32_t>(0);
      const std::string_view kind = std::string_view(head).substr(4);
      if (kind == "IEND") return {};
      at_ += 8;
      if (kind == "IDAT") {
        left_ = size;
        sum_ = crc32(0, reinterpret_cast<const Bytef*>(kind.data()), 4);
      }
      if (kind != "IDAT" || size == 0) at_ += std::uint64_t{size} + kChecksumBytes;
    }
    std::string piece = file_.text(at_, std::min<std::uint64_t>(left_, kPieceBytes));
    if (piece.empty()) throw_damaged_png();
    at_ += piece.size();
    left_ -= piece.size();
    sum_ =
        crc32(sum_, reinterpret_cast<const Bytef*>(piece.data()), static_cast<uInt>(piece.size()));
    if (left_ == 0) check_sum();
    return piece;
  }

 private:
  static constexpr std::uint64_t kChecksumBytes = 4;

  void check_sum() {
    const std::string sum = file_.text(at_, kChecksumBytes);
    if (sum.size() < kChecksumBytes || HeaderBytes(sum, true).at<std::uint32_t>(0) != sum_) {
      throw_damaged_png();
    }
    at_ += kChecksumBytes;
  }

  const InputFile& file_;
  std::uint64_t at_ = kMagic.size();
  std::uint64_t left_ = 0;  // of the present chunk
  uLong sum_ = 0;           // of what was read of it
};

class Inflater {
 public:
  explicit Inflater(const InputFile& file) : data_(file) {
    if (inflateInit(&stream_) != Z_OK) throw std::bad_alloc();
  }
  ~Inflater() { inflateEnd(&stream_); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;

  void read(std::span<std::uint8_t> target) {
    stream_.next_out = target.data();
    stream_.avail_out = static_cast<uInt>(target.size());
    while (stream_.avail_out > 0) {
      if (stream_.avail_in == 0) refill();
      const int state = inflate(&stream_, Z_NO_FLUSH);
      is_ended_ = state == Z_STREAM_END;
      if (state != Z_OK && !(is_ended_ && stream_.avail_out == 0)) throw_damaged_png();
    }
  }

  // Throws unless the data end here, with all checksums right.
  void finish() {
    std::uint8_t more = 0;
    stream_.next_out = &more;
    stream_.avail_out = 1;
    while (!is_ended_) {
      if (stream_.avail_in == 0) refill();
      const int state = inflate(&stream_, Z_NO_FLUSH);
      is_ended_ = state == Z_STREAM_END;
      if ((state != Z_OK && !is_ended_) || stream_.avail_out == 0) throw_damaged_png();
    }
    while (!data_.next().empty()) continue;
  }

 private:
  void refill() {
    piece_ = data_.next();
    if (piece_.empty()) throw_damaged_png();
    stream_.next_in = reinterpret_cast<Bytef*>(piece_.data());
    stream_.avail_in = static_cast<uInt>(piece_.size());
  }

  ImageData data_;
  z_stream stream_ = {};
  bool is_ended_ = false;
  std::string piece_;
};

// Of the left, upper and upper left byte, the one nearest to left + up - corner.
std::uint8_t paeth(int left, int up, int corner) {
  const int estimate = left + up - corner;
  const int to_left = std::abs(estimate - left);
  const int to_up = std::abs(estimate - up);
  const int to_corner = std::abs(estimate - corner);
  if (to_left <= to_up && to_left <= to_corner) return static_cast<std::uint8_t>(left);
  return static_cast<std::uint8_t>(to_up <= to_corner ? up : corner);
}

void unfilter(std::uint8_t filter, std::size_t bytes_each, std::span<const std::uint8_t> above,
              std::span<std::uint8_t> row) {
  for (std::size_t at = 0; at < row.size(); ++at) {
    const int left = at >= bytes_each ? row[at - bytes_each] : 0;
    const int corner = at >= bytes_each ? above[at - bytes_each] : 0;
    const int up = above[at];
    const std::array<int, 5> added = {0, left, up, (left + up) / 2, paeth(left, up, corner)};
    if (filter >= added.size()) throw_damaged_png();
    row[at] = static_cast<std::uint8_t>(row[at] + added[filter]);
  }
}

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
  constexpr std::uint32_t kMost = 1U << 20;
  const PageLayout layout = {header.at<std::uint32_t>(16), header.at<std::uint32_t>(20),
                             bits == 8 ? StoredType::kUint8 : StoredType::kUint16};
  if (layout.width == 0 || layout.height == 0 || layout.width > kMost || layout.height > kMost) {
    throw_unusable("The size of the PNG image is not plausible.");
  }
  return layout;
}

}  // namespace

bool is_png(std::string_view head) {
  return head.size() >= 33 && head.starts_with(kMagic) && head.substr(12, 4) == "IHDR";
}

void read_png(const InputFile& file, const PageCheck& check, const PageSink& sink) {
  const std::string head = file.text(0, 33);
  if (!is_png(head)) throw_damaged_png();
  const PageLayout layout = layout_of(head);
  check(layout);
  const std::size_t bytes_each = bytes_per_sample(layout.type);
  std::vector<std::uint8_t> above(layout.width * bytes_each, 0);
  std::vector<std::uint8_t> row(above.size() + 1);
  Inflater inflater(file);
  for (std::uint32_t y = 0; y < layout.height; ++y) {
    inflater.read(row);
    const std::span<std::uint8_t> samples = std::span(row).subspan(1);
    unfilter(row[0], bytes_each, above, samples);
    std::ranges::copy(samples, above.begin());
    if (bytes_each > 1) swap_bytes(std::as_writable_bytes(samples), bytes_each);
    sink(std::as_bytes(samples));
  }
  inflater.finish();
}

}  // namespace isomesh::import
