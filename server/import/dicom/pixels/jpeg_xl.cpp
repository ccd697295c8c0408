#include "server/import/dicom/pixels/jpeg_xl.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <jxl/decode.h>
#include <jxl/decode_cxx.h>

namespace isomesh::import::dicom {
namespace {

// One channel of numbers from 0 to 1: integers of libjxl 0.7 are stretched to all bits of their
// type. Floats keep samples of up to 16 bits exactly.
constexpr JxlPixelFormat kFormat = {1, JXL_TYPE_FLOAT, JXL_NATIVE_ENDIAN, 0};

// Decodes in this thread alone, because it has no runner.
class Decoder {
 public:
  Decoder(std::span<const std::byte> stream, int events) : decoder_(JxlDecoderMake(nullptr)) {
    is_usable_ =
        decoder_ != nullptr &&
        JxlDecoderSubscribeEvents(decoder_.get(), events) == JXL_DEC_SUCCESS &&
        JxlDecoderSetInput(decoder_.get(), reinterpret_cast<const std::uint8_t*>(stream.data()),
                           stream.size()) == JXL_DEC_SUCCESS;
  }

  JxlDecoderStatus next() {
    return is_usable_ ? JxlDecoderProcessInput(decoder_.get()) : JXL_DEC_ERROR;
  }
  JxlDecoder* get() { return decoder_.get(); }

 private:
  JxlDecoderPtr decoder_;
  bool is_usable_ = false;
};

struct Rows {
  std::span<std::byte> target;
  std::size_t columns = 0;
  std::size_t bytes_per_sample = 1;
  float largest = 0;

  void write(std::size_t column, std::size_t row, std::span<const float> shares) const {
    std::size_t at = (row * columns + column) * bytes_per_sample;
    if (at + shares.size() * bytes_per_sample > target.size()) return;
    for (const float share : shares) {
      // Lossy streams may exceed the range. A share that is not a number becomes 0.
      const float bounded = share > 0 ? std::min(share, 1.0F) : 0.0F;
      const auto sample = static_cast<std::uint32_t>(std::lround(bounded * largest));
      for (std::size_t byte = 0; byte < bytes_per_sample; ++byte) {
        target[at++] = static_cast<std::byte>(sample >> 8 * byte & 0xFFU);
      }
    }
  }
};

void write_pixels(void* rows, std::size_t column, std::size_t row, std::size_t count,
                  const void* pixels) {
  static_cast<const Rows*>(rows)->write(column, row, {static_cast<const float*>(pixels), count});
}

}  // namespace

std::optional<StreamSize> jpeg_xl_size(std::span<const std::byte> stream) {
  Decoder decoder(stream, JXL_DEC_BASIC_INFO);
  JxlBasicInfo info = {};
  if (decoder.next() != JXL_DEC_BASIC_INFO ||
      JxlDecoderGetBasicInfo(decoder.get(), &info) != JXL_DEC_SUCCESS ||
      info.exponent_bits_per_sample != 0 || info.have_animation != JXL_FALSE) {
    return std::nullopt;
  }
  return StreamSize{.columns = info.xsize,
                    .rows = info.ysize,
                    .components = info.num_color_channels + info.num_extra_channels,
                    .bits = info.bits_per_sample};
}

bool decode_jpeg_xl(std::span<const std::byte> stream, const StreamSize& size,
                    std::size_t bytes_per_sample, std::span<std::byte> target) {
  Decoder decoder(stream, JXL_DEC_FULL_IMAGE);
  Rows rows = {.target = target,
               .columns = size.columns,
               .bytes_per_sample = bytes_per_sample,
               .largest = static_cast<float>((1U << size.bits) - 1)};
  JxlDecoderStatus status = decoder.next();
  if (status == JXL_DEC_NEED_IMAGE_OUT_BUFFER &&
      JxlDecoderSetImageOutCallback(decoder.get(), &kFormat, write_pixels, &rows) ==
          JXL_DEC_SUCCESS) {
    status = decoder.next();
  }
  return status == JXL_DEC_FULL_IMAGE;
}

}  // namespace isomesh::import::dicom
