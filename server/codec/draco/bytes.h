// Byte and bit output of a stream. Private to this folder.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <utility>
#include <vector>

namespace isomesh::codec::edgebreaker {

static_assert(std::endian::native == std::endian::little, "Draco's streams are little-endian");

// Appends to a buffer that it owns. Not thread safe.
class ByteWriter {
 public:
  void byte(std::uint32_t value) { bytes_.push_back(static_cast<std::byte>(value)); }

  template <class T>
  void raw(T value) {
    append(std::as_bytes(std::span(&value, 1)));
  }

  // Seven bits per byte, lowest first; all bytes but the last have the highest bit set.
  void varint(std::uint64_t value) {
    for (; value >= 0x80; value >>= 7) byte(static_cast<std::uint32_t>(value & 0x7F) | 0x80U);
    byte(static_cast<std::uint32_t>(value));
  }

  void append(std::span<const std::byte> bytes) {
    if (!bytes.empty()) std::memcpy(extend(bytes.size()), bytes.data(), bytes.size());
  }

  // Appends zeros, which the caller overwrites before it appends more.
  std::byte* extend(std::size_t count) {
    bytes_.resize(bytes_.size() + count);
    return bytes_.data() + bytes_.size() - count;
  }

  // Appends the bytes after their number.
  void counted(std::span<const std::byte> bytes) {
    varint(bytes.size());
    append(bytes);
  }

  void reserve(std::size_t bytes) { bytes_.reserve(bytes); }
  std::vector<std::byte> take() { return std::move(bytes_); }

 private:
  std::vector<std::byte> bytes_;
};

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
