// Pixels as image files store them, in rows of whole bytes, and their samples.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/import/images/page.h"

namespace isomesh::import {

struct PixelForm {
  unsigned bits = 8;         // of a component: 1, 2, 4, 8, 16, 32 or 64; the first pixel is highest
  unsigned components = 1;   // grey or an index; 3 for colours; one more behind them
  bool has_opacity = false;  // the last component
  bool is_half = false;      // floats of 16 bits, which become float32

  std::uint64_t row_bytes(std::uint32_t width) const {
    return (std::uint64_t{width} * components * bits + 7) / 8;
  }
  // True if pixels are samples.
  bool is_plain() const { return bits >= 8 && components == 1 && !is_half; }
};

// The type of samples for pixels of unsigned integers.
StoredType integer_type(const PixelForm& form);

// Pixels of a page -> samples. Not thread safe.
class Pixels {
 public:
  Pixels(const PixelForm& form, std::uint32_t width) : form_(form), width_(width) {}

  // The samples of whole rows, valid until the next call. Those of fewer than 8 bits are not
  // scaled. Throws Error kUnusableVolume if a pixel is not grey, or not opaque.
  std::span<std::byte> samples(std::span<std::byte> rows);

 private:
  void unpack(std::span<const std::byte> rows);
  template <class Sample>
  void take_grey(std::span<const std::byte> rows);
  void widen(std::span<const std::byte> rows);

  PixelForm form_;
  std::uint32_t width_;
  std::vector<std::byte> samples_;
};

// Throws Error kUnusableVolume with the ways out for a picture of colours.
[[noreturn]] void throw_coloured();

}  // namespace isomesh::import
