#include "server/import/images/tiff_description.h"

#include <cmath>
#include <vector>

#include "base/error.h"
#include "base/text.h"
#include "proto/error.h"
#include "server/import/source/names.h"
#include "server/import/source/source.h"

namespace isomesh::import {

std::optional<double> described_length(std::string_view unit) {
  Geometry geometry;
  std::vector<Note> notes;
  try {
    scale_to_millimetres(geometry, unit == "\\u00B5m" ? "um" : unit, notes);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kUnusableVolume) throw;
    return std::nullopt;
  }
  if (!notes.empty()) return std::nullopt;
  return geometry.spacing[0];
}

std::optional<double> described_positive(std::string_view text) {
  const auto number = parse_double(text);
  return number && std::isfinite(*number) && *number > 0 ? number : std::nullopt;
}

std::uint64_t described_count(std::string_view text, std::uint64_t otherwise) {
  const auto count = parse_uint64(text);
  return count && *count >= 1 && *count <= kMostOfAKind ? *count : otherwise;
}

}  // namespace isomesh::import
