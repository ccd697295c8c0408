// Bit output. Private to this folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace isomesh::codec::edgebreaker {

// Writes bits in order, lowest first. Not thread safe.
class BitWriter {
 public:
  static std::size_t bytes_of(std::uint64_t bits) {
    return static_cast<std::size_t>((bits + 7) / 8);
  }

  // `out` has room for bytes_of all bits.
  explicit BitWriter(std::byte* out) : out_(out) {}

  // Writes the lowest `bits` bits, at most 32; the others must be zero.
  void put(std::uint32_t value, std::uint32_t bits) {
    word_ |= std::uint64_t{value} << used_;
    used_ += bits;
    if (used_ >= 32) {
      std::memcpy(out_, &word_, 4);
      out_ += 4;
      word_ >>= 32;
      used_ -= 32;
    }
  }

  void finish() { std::memcpy(out_, &word_, bytes_of(used_)); }

 private:
  std::byte* out_;
  std::uint64_t word_ = 0;
  std::uint32_t used_ = 0;
};

}  // namespace isomesh::codec::edgebreaker
