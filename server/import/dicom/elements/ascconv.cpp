#include "server/import/dicom/elements/ascconv.h"

#include <array>
#include <cmath>
#include <map>
#include <string>

#include "base/text.h"

namespace isomesh::import::dicom {
namespace {

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
  if (found == values.end()) return 0;
  const auto parsed = parse_double(found->second);
  return parsed && std::isfinite(*parsed) ? parsed : std::nullopt;
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
