// Fields of headers: numbers in binary ones, and texts by their names in others.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace isomesh::import {

using HeaderTexts = std::map<std::string, std::string, std::less<>>;

// Returns an empty text for a missing field.
inline std::string_view value_of(const HeaderTexts& texts, std::string_view name) {
  const auto found = texts.find(name);
  return found == texts.end() ? std::string_view{} : std::string_view(found->second);
}

// Empty unless the text is a finite number, or all are: parts, or those between white space.
std::optional<double> finite_number(std::string_view text);
template <class Texts>
std::vector<double> finite_numbers_of(const Texts& parts) {
  std::vector<double> numbers;
  for (const std::string_view part : parts) {
    const auto number = finite_number(part);
    if (!number) return {};
    numbers.push_back(*number);
  }
  return numbers;
}
std::vector<double> finite_numbers(std::string_view text);

// The same number if it is whole and from 0 to 1e9. Throws Error kUnusableVolume, with `what`
// before "is not plausible".
std::uint64_t plausible_whole(double number, const std::string& what);

// Of the header that messages call `title`, "The NRRD header". All throw Error kUnusableVolume:
// if the value has control characters or the field is there already; if the field is missing or
// empty; if the sizes are not as many numbers as the field `count` says, from 1 to `most`.
void add_field(HeaderTexts& texts, std::string_view title, const std::string& name,
               std::string_view value);
std::string_view required(const HeaderTexts& texts, std::string_view title, std::string_view name);
std::vector<std::uint64_t> required_sizes(const HeaderTexts& texts, std::string_view title,
                                          std::string_view count, std::string_view sizes,
                                          std::uint64_t most);

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
