// Fields of headers: numbers in binary ones, and texts by their names in others.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <functional>
#include <map>
#include <string>
#include <string_view>

namespace isomesh::import {

using HeaderTexts = std::map<std::string, std::string, std::less<>>;

// Returns an empty text for a missing field.
inline std::string_view value_of(const HeaderTexts& texts, std::string_view name) {
  const auto found = texts.find(name);
  return found == texts.end() ? std::string_view{} : std::string_view(found->second);
}

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
