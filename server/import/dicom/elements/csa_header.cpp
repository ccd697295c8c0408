#include "server/import/dicom/elements/csa_header.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <string>

#include "base/text.h"
#include "server/import/source/header_fields.h"
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

  std::uint32_t number() { return HeaderBytes(take(4), false).at<std::uint32_t>(0); }

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

constexpr double kMostSlices = 4096;

using Values = std::map<std::string_view, std::string_view, std::less<>>;

// The text between the marks; empty if one is missing.
std::string_view protocol_of(std::string_view header) {
  const std::size_t begin = header.find("### ASCCONV BEGIN");
  if (begin == header.npos) return {};
  header.remove_prefix(begin);
  return header.substr(0, header.find("### ASCCONV END"));
}

// The lines "name = value" on the slices.
Values values_of(std::string_view protocol) {
  Values values;
  while (!protocol.empty()) {
    const std::size_t end = protocol.find('\n');
    const std::string_view line = protocol.substr(0, end);
    protocol.remove_prefix(end == protocol.npos ? protocol.size() : end + 1);
    const std::size_t equals = line.find('=');
    if (equals == line.npos || !line.starts_with("sSliceArray.")) continue;
    values.emplace(trimmed(line.substr(0, equals)), trimmed(line.substr(equals + 1)));
  }
  return values;
}

// Empty if the number is not finite. A missing one is 0.
std::optional<double> number(const Values& values, const std::string& name) {
  const auto found = values.find(name);
  return found == values.end() ? 0.0 : finite_number(found->second);
}

std::optional<Vector3> vector(const Values& values, const std::string& name) {
  constexpr std::array kAxes = {".dSag", ".dCor", ".dTra"};
  Vector3 result = {};
  for (std::size_t axis = 0; axis < kAxes.size(); ++axis) {
    const auto part = number(values, name + kAxes[axis]);
    if (!part) return std::nullopt;
    result[axis] = *part;
  }
  return result;
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
  return found == header.end() ? std::vector<double>{} : finite_numbers_of(found->second);
}

std::optional<ProtocolSlices> protocol_slices(std::string_view header) {
  const Values values = values_of(protocol_of(header));
  const auto count = number(values, "sSliceArray.lSize");
  if (!count || !(*count >= 1 && *count <= kMostSlices) || std::floor(*count) != *count) {
    return std::nullopt;
  }
  const auto slices = static_cast<std::uint32_t>(*count);
  const std::string last_name = "sSliceArray.asSlice[" + std::to_string(slices - 1) + "].sPosition";
  const auto first = vector(values, "sSliceArray.asSlice[0].sPosition");
  const auto last = vector(values, last_name);
  const auto normal = vector(values, "sSliceArray.asSlice[0].sNormal");
  if (!first || !last || !normal) return std::nullopt;
  return ProtocolSlices{slices, *first, *last, *normal};
}

}  // namespace isomesh::import::dicom
