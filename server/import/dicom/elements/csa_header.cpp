#include "server/import/dicom/elements/csa_header.h"

#include <cmath>
#include <cstdint>

#include "base/text.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

// Scanners write about a hundred fields with a few values each.
constexpr std::uint32_t kMostFields = 1024;
constexpr std::uint32_t kMostItems = 1024;
constexpr std::size_t kNameBytes = 64;

[[noreturn]] void throw_corrupt() {
  throw_unusable("The DICOM image's Siemens header (0029,1010) is truncated or corrupt.");
}

class Cursor {
 public:
  explicit Cursor(std::string_view bytes) : rest_(bytes) {}

  std::string_view take(std::size_t count) {
    if (count > rest_.size()) throw_corrupt();
    const std::string_view piece = rest_.substr(0, count);
    rest_.remove_prefix(count);
    return piece;
  }

  // The last value may lack its padding.
  void skip_padding(std::size_t count) { rest_.remove_prefix(std::min(count, rest_.size())); }

  std::uint32_t number() {
    std::uint32_t result = 0;
    for (unsigned shift = 0; const char byte : take(4)) {
      result |= std::uint32_t{static_cast<unsigned char>(byte)} << shift;
      shift += 8;
    }
    return result;
  }

  std::uint32_t count(std::uint32_t most) {
    const std::uint32_t result = number();
    if (result > most) throw_corrupt();
    return result;
  }

 private:
  std::string_view rest_;
};

std::string_view up_to_zero(std::string_view text) { return text.substr(0, text.find('\0')); }

std::vector<std::string> take_items(Cursor& cursor, std::uint32_t count) {
  std::vector<std::string> values;
  for (std::uint32_t item = 0; item < count; ++item) {
    // The second of its four numbers is the length in both layouts.
    cursor.take(4);
    const std::uint32_t length = cursor.number();
    cursor.take(8);
    const std::string_view value = trimmed(up_to_zero(cursor.take(length)));
    cursor.skip_padding((4 - length % 4) % 4);
    if (!value.empty()) values.emplace_back(value);
  }
  return values;
}

}  // namespace

CsaHeader parse_csa_header(std::string_view bytes) {
  Cursor cursor(bytes);
  if (bytes.starts_with("SV10")) cursor.take(8);
  const std::uint32_t fields = cursor.count(kMostFields);
  cursor.take(4);
  CsaHeader header;
  for (std::uint32_t field = 0; field < fields; ++field) {
    const std::string name(up_to_zero(cursor.take(kNameBytes)));
    cursor.take(12);  // number and kind of values
    const std::uint32_t items = cursor.count(kMostItems);
    cursor.take(4);
    header.insert_or_assign(name, take_items(cursor, items));
  }
  return header;
}

std::vector<double> csa_numbers(const CsaHeader& header, std::string_view field) {
  const auto found = header.find(field);
  if (found == header.end()) return {};
  std::vector<double> numbers;
  for (const std::string& value : found->second) {
    const auto number = parse_double(value);
    if (!number || !std::isfinite(*number)) return {};
    numbers.push_back(*number);
  }
  return numbers;
}

}  // namespace isomesh::import::dicom
