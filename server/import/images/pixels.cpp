#include "server/import/images/pixels.h"

#include <algorithm>
#include <cstring>
#include <limits>

#include "server/import/source/names.h"

namespace isomesh::import {

void throw_coloured() {
  throw_unusable(
      "The picture has colours, but a sample is one number. Convert it to grey. If the colours "
      "stand for labels, save it as an indexed picture: the indices of its palette become labels.");
}

StoredType integer_type(const PixelForm& form) {
  return form.bits <= 8 ? StoredType::kUint8 : StoredType::kUint16;
}

std::span<std::byte> Pixels::samples(std::span<std::byte> rows) {
  if (form_.is_plain()) return rows;
  samples_.clear();
  if (form_.is_half) {
    widen(rows);
  } else if (form_.components == 1) {
    unpack(rows);
  } else if (form_.bits == 8) {
    take_grey<std::uint8_t>(rows);
  } else {
    take_grey<std::uint16_t>(rows);
  }
  return samples_;
}

void Pixels::unpack(std::span<const std::byte> rows) {
  const std::uint64_t row_bytes = form_.row_bytes(width_);
  const unsigned in_byte = 8 / form_.bits;
  const unsigned mask = (1U << form_.bits) - 1;
  samples_.resize(rows.size() / row_bytes * width_);
  std::byte* target = samples_.data();
  for (; rows.size() >= row_bytes; rows = rows.subspan(row_bytes)) {
    for (std::uint32_t x = 0; x < width_; ++x) {
      const unsigned shift = 8 - form_.bits * (x % in_byte + 1);
      *target++ = (rows[x / in_byte] >> shift) & std::byte(mask);
    }
  }
}

template <class Sample>
void Pixels::take_grey(std::span<const std::byte> rows) {
  const std::size_t count = rows.size() / (sizeof(Sample) * form_.components);
  const unsigned colours = form_.components >= 3 ? 3 : 1;
  samples_.resize(count * sizeof(Sample));
  std::vector<Sample> pixel(form_.components);
  for (std::size_t at = 0; at < count; ++at) {
    std::memcpy(pixel.data(), rows.data() + at * sizeof(Sample) * form_.components,
                sizeof(Sample) * form_.components);
    for (unsigned colour = 1; colour < colours; ++colour) {
      if (pixel[colour] != pixel[0]) throw_coloured();
    }
    if (form_.has_opacity && pixel.back() != std::numeric_limits<Sample>::max()) {
      throw_unusable("The picture is transparent in places. Save it without an alpha channel.");
    }
    std::memcpy(samples_.data() + at * sizeof(Sample), pixel.data(), sizeof(Sample));
  }
}

void Pixels::widen(std::span<const std::byte> rows) {
  std::vector<std::uint16_t> halves(rows.size() / sizeof(std::uint16_t));
  std::memcpy(halves.data(), rows.data(), halves.size() * sizeof(std::uint16_t));
  std::vector<float> floats(halves.size());
  floats_of_halves(halves, floats);
  const auto bytes = std::as_bytes(std::span(floats));
  samples_.assign(bytes.begin(), bytes.end());
}

}  // namespace isomesh::import
