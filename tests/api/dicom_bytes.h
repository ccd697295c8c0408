// DICOM written byte by byte, in explicit little-endian form.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace isomesh::test {

// Writes a number over the bytes there.
template <class Number>
void put(std::string& bytes, std::size_t at, Number number) {
  bytes.replace(at, sizeof(Number), reinterpret_cast<const char*>(&number), sizeof(Number));
}

// One element, whose value is padded to an even length.
inline std::string element(std::uint16_t group, std::uint16_t number, const std::string& kind,
                           std::string value) {
  if (value.size() % 2 != 0) value += kind == "UI" ? '\0' : ' ';
  std::string head(8, '\0');
  put(head, 0, group);
  put(head, 2, number);
  head.replace(4, 2, kind);
  const bool is_long = kind == "OW" || kind == "OB" || kind == "SQ";
  if (is_long) head.resize(12);
  if (is_long) put(head, 8, static_cast<std::uint32_t>(value.size()));
  if (!is_long) put(head, 6, static_cast<std::uint16_t>(value.size()));
  return head + value;
}

// An element of 16 bits.
inline std::string number(std::uint16_t group, std::uint16_t tag, std::uint16_t value) {
  std::string bytes(2, '\0');
  put(bytes, 0, value);
  return element(group, tag, "US", bytes);
}

inline std::string little(std::uint32_t value) {
  std::string bytes(4, '\0');
  put(bytes, 0, value);
  return bytes;
}

inline std::string sequence(std::uint16_t group, std::uint16_t tag,
                            const std::vector<std::string>& items) {
  std::string value;
  for (const std::string& item : items) {
    value +=
        std::string("\xFE\xFF\x00\xE0", 4) + little(static_cast<std::uint32_t>(item.size())) + item;
  }
  return element(group, tag, "SQ", value);
}

// A file of these elements.
inline std::string dicom(const std::string& data_set,
                         const std::string& transfer_syntax = "1.2.840.10008.1.2.1") {
  const std::string meta = element(2, 0x10, "UI", transfer_syntax);
  return std::string(128, '\0') + "DICM" +
         element(2, 0, "UL", little(static_cast<std::uint32_t>(meta.size()))) + meta + data_set;
}

}  // namespace isomesh::test
