#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/text.h"
#include "server/import/formats/format_readers.h"
#include "server/import/formats/vtk_arrays.h"

namespace isomesh::import {
namespace {

constexpr std::string_view kFirstLine = "# vtk DataFile Version ";
constexpr std::size_t kMostLegacyHeaderBytes = std::size_t{1} << 16;

struct LegacyHeader {
  bool is_text = false;
  std::array<std::uint64_t, 3> points = {0, 0, 0};
  std::optional<Vector3> spacing;
  Vector3 origin = {0, 0, 0};
  std::uint64_t bytes = 0;  // up to the first line of data
};

Vector3 numbers_of(const std::vector<std::string_view>& parts) {
  Vector3 numbers = {};
  for (std::size_t at = 0; at < 3; ++at) {
    const auto number = parts.size() == 4 ? parse_double(parts[at + 1]) : std::nullopt;
    if (!number || !std::isfinite(*number)) {
      throw_unusable("The VTK file's " + in_quotes(parts[0]) + " is not three finite numbers.");
    }
    numbers[at] = *number;
  }
  return numbers;
}

std::array<std::uint64_t, 3> sizes_of(const std::vector<std::string_view>& parts) {
  std::array<std::uint64_t, 3> sizes = {};
  for (std::size_t at = 0; at < 3; ++at) {
    const auto size = parts.size() == 4 ? parse_uint64(parts[at + 1]) : std::nullopt;
    if (!size) throw_unusable("The VTK file's DIMENSIONS are not three whole numbers.");
    sizes[at] = *size;
  }
  return sizes;
}

// The second of the five parts of the format is a title; the third and the fourth are keywords.
void read_kind(std::string_view text, const std::vector<std::string_view>& parts,
               LegacyHeader& header) {
  if (text == "ASCII" || text == "BINARY") {
    header.is_text = text == "ASCII";
  } else if (parts[0] == "DATASET" && parts.size() > 1 && parts[1] != "STRUCTURED_POINTS") {
    throw_unusable("The VTK file holds " + in_quotes(parts[1]) +
                   ". Only STRUCTURED_POINTS are a volume.");
  }
}

LegacyHeader read_legacy_header(std::string_view text) {
  LegacyHeader header;
  std::size_t line = 0;
  for (std::size_t next = 0;; ++line) {
    const std::size_t end = text.find('\n', next);
    if (end == std::string_view::npos) break;
    const std::string_view whole = trimmed(text.substr(next, end - next));
    const auto parts = words(whole);
    if (line >= 2 && !parts.empty()) {
      if (parts[0] == "POINT_DATA" || parts[0] == "CELL_DATA") {
        header.bytes = next;
        return header;
      }
      if (parts[0] == "DIMENSIONS") header.points = sizes_of(parts);
      if (parts[0] == "SPACING" || parts[0] == "ASPECT_RATIO") header.spacing = numbers_of(parts);
      if (parts[0] == "ORIGIN") header.origin = numbers_of(parts);
      read_kind(whole, parts, header);
    }
    next = end + 1;
  }
  throw_unusable("The VTK file has neither point data nor cell data.");
}

// The only array of one component of the points or the cells, or the one that is called scalars.
const VtkArray* scalars_of(const std::vector<VtkArray>& arrays, bool is_of_cells) {
  const VtkArray* found = nullptr;
  for (const VtkArray& array : arrays) {
    if (array.is_of_cells != is_of_cells || (array.components != 1 && !array.is_scalars)) continue;
    if (array.is_scalars) return &array;
    if (found != nullptr) {
      throw_unusable("The VTK file has several arrays, but does not say which one is its scalars.");
    }
    found = &array;
  }
  return found;
}

void take(const VtkArray& array, const LegacyHeader& header, const ImportOptions& options,
          SourceVolume& volume) {
  if (array.components != 1) {
    throw_unusable("Each sample of the VTK file has " + std::to_string(array.components) +
                   " components. A sample must be one real number.");
  }
  const auto type = vtk_type(array.type);
  if (!type) {
    throw_unusable("The VTK file's type " + in_quotes(array.type) +
                   " is not supported. A sample must be one real number.");
  }
  std::array<std::uint64_t, 3> sizes = header.points;
  volume.geometry.origin = header.origin;
  volume.assumes_spacing = !header.spacing;
  volume.geometry.spacing = header.spacing.value_or(options.spacing.value_or(Vector3{1, 1, 1}));
  for (std::size_t axis = 0; array.is_of_cells && axis < 3; ++axis) {
    if (sizes[axis] < 2) continue;
    --sizes[axis];
    volume.geometry.origin[axis] += volume.geometry.spacing[axis] / 2;
  }
  volume.dims = volume_dims(sizes);
  if (array.tuples != volume.sample_count()) {
    throw_unusable("The VTK file contradicts itself: its DIMENSIONS need " +
                   std::to_string(volume.sample_count()) + " samples, but its array has " +
                   std::to_string(array.tuples) + ".");
  }
  volume.layout.type = *type;
  volume.layout.big_endian = !header.is_text;
}

// In text the samples end where the next section begins.
std::uint64_t text_bytes(const InputFile& file, std::uint64_t offset) {
  for (std::uint64_t next = offset; next < file.size();) {
    const std::string piece = file.text(next, kPieceBytes);
    const std::size_t letter = piece.find_first_of("ABCDFGHIJKLMOPQRSTUVWXYZ_");
    if (letter != std::string::npos) {
      const std::size_t line = piece.find_last_of('\n', letter);
      return next + (line == std::string::npos ? letter : line) - offset;
    }
    next += piece.size();
  }
  return file.size() - offset;
}

}  // namespace

bool is_vtk_legacy(std::string_view head) { return head.starts_with(kFirstLine); }

bool may_hold_structured_points(std::string_view head) {
  const std::size_t kind = head.find("DATASET");
  return kind == std::string_view::npos ||
         trimmed(head.substr(kind + 7, 64)).starts_with("STRUCTURED_POINTS");
}

SourceVolume parse_vtk_legacy(const InputFile& file, const Companions& /*companions*/,
                              const ImportOptions& options) {
  const LegacyHeader header = read_legacy_header(file.text(0, kMostLegacyHeaderBytes));
  const auto arrays = vtk_arrays(file, header.bytes, header.is_text);
  const VtkArray* array = scalars_of(arrays, false);
  if (array == nullptr) array = scalars_of(arrays, true);
  if (array == nullptr) throw_unusable("The VTK file has no array of single numbers.");
  SourceVolume volume;
  take(*array, header, options, volume);
  choose_volume(1, {}, options, volume);
  volume.payload = {array->offset, file.size() - std::min(file.size(), array->offset)};
  volume.has_footer = true;
  if (header.is_text) {
    volume.encoding = array->is_colors ? Encoding::kFractionText : Encoding::kText;
    volume.payload.bytes = text_bytes(file, array->offset);
  }
  return volume;
}

MostBytes most_vtk_legacy_bytes(const InputFile& beginning, const ImportTask& task) {
  return most_vtk_bytes(
      volume_dims(read_legacy_header(beginning.text(0, kMostLegacyHeaderBytes)).points), task);
}

}  // namespace isomesh::import
