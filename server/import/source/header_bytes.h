// Numbers in a binary header.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <string_view>

namespace isomesh::import {

// Reads numbers of either byte order. The caller makes sure that `bytes` holds them.
class HeaderBytes {
 public:
  HeaderBytes(std::string_view bytes, bool big_endian) : bytes_(bytes), big_endian_(big_endian) {}

  template <class Stored>
  Stored at(std::size_t offset) const {
    std::array<std::byte, sizeof(Stored)> raw;
    std::memcpy(raw.data(), bytes_.data() + offset, sizeof(Stored));
    if (big_endian_) std::reverse(raw.begin(), raw.end());
    Stored value;
    std::memcpy(&value, raw.data(), sizeof(Stored));
    return value;
  }

  template <class Stored, class Value, std::size_t Count>
  void read(std::size_t offset, std::array<Value, Count>& values) const {
    for (Value& value : values) {
      value = at<Stored>(offset);
      offset += sizeof(Stored);
    }
  }

 private:
  std::string_view bytes_;
  bool big_endian_;
};

}  // namespace isomesh::import
