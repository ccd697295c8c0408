#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/text.h"
#include "server/import/formats/format_readers.h"
#include "server/import/formats/vtk.h"
#include "server/import/source/line_reader.h"

namespace isomesh::import {
namespace {

constexpr std::string_view kFirstLine = "# vtk DataFile Version ";
constexpr std::uint64_t kMostLegacyHeaderBytes = std::uint64_t{1} << 16;

struct LegacyHeader {
  bool is_text = false;
  std::array<std::uint64_t, 3> points = {0, 0, 0};
  std::array<std::int64_t, 3> first = {0, 0, 0};  // the index of the first point
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
void read_kind(const std::string& text, const std::vector<std::string_view>& parts,
               LegacyHeader& header) {
  if (text == "ascii" || text == "binary") {
    header.is_text = text == "ascii";
  } else if (lower(parts[0]) == "dataset" && parts.size() > 1 &&
             lower(parts[1]) != "structured_points") {
    throw_unusable("The VTK file holds " + in_quotes(parts[1]) +
                   ". Only STRUCTURED_POINTS are a volume.");
  }
}

void read_line(std::string_view line, const std::vector<std::string_view>& parts,
               LegacyHeader& header) {
  const std::string keyword = lower(parts[0]);
  if (keyword == "dimensions") header.points = sizes_of(parts);
  if (keyword == "extent") {
    const VtkExtent extent = vtk_extent(line.substr(keyword.size()), parts[0]);
    std::ranges::copy(extent.dims, header.points.begin());
    header.first = extent.first;
  }
  if (keyword == "spacing" || keyword == "aspect_ratio") header.spacing = numbers_of(parts);
  if (keyword == "origin") header.origin = numbers_of(parts);
  read_kind(lower(line), parts, header);
}

LegacyHeader read_legacy_header(const InputFile& file) {
  LegacyHeader header;
  LineReader lines(file, {.header = "The VTK file's header", .bytes = kMostLegacyHeaderBytes});
  lines.next_ended();
  lines.next_ended();  // the title
  header.bytes = lines.offset();
  while (const auto line = lines.next_ended()) {
    const std::string_view whole = trimmed(*line);
    const auto parts = words(whole);
    if (!parts.empty()) {
      const std::string keyword = lower(parts[0]);
      if (keyword == "point_data" || keyword == "cell_data") return header;
      read_line(whole, parts, header);
    }
    header.bytes = lines.offset();
  }
  throw_unusable("The VTK file has neither point data nor cell data.");
}

// The array of points or cells that is called scalars. Without one all that can be.
std::vector<const VtkArray*> scalars_of(const std::vector<VtkArray>& arrays, bool is_of_cells) {
  std::vector<const VtkArray*> found;
  for (const VtkArray& array : arrays) {
    if (array.is_of_cells != is_of_cells) continue;
    if (array.is_scalars) return {&array};
    if (array.components == 1 && !is_vtk_mask(array.name)) found.push_back(&array);
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
  for (std::size_t axis = 0; axis < 3; ++axis) {
    volume.geometry.origin[axis] +=
        volume.geometry.spacing[axis] * static_cast<double>(header.first[axis]);
    if (!array.is_of_cells || sizes[axis] < 2) continue;
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
    // "nan" and "inf" are numbers. Each keyword has a letter that they and exponents do not have.
    const std::size_t letter = piece.find_first_of("ABCDFGHIJKLMOPQRSTUVWXYZ_bcdghjklmopqrsuvwxz");
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
  // The title, in the second line, may have the keyword too.
  const std::size_t title = head.find('\n');
  const std::size_t behind = title == head.npos ? head.npos : head.find('\n', title + 1);
  if (behind == head.npos) return true;
  const std::string text = lower(head.substr(behind));
  const std::size_t kind = text.find("dataset");
  return kind == std::string::npos ||
         trimmed(std::string_view(text).substr(kind + 7, 64)).starts_with("structured_points");
}

SourceVolume parse_vtk_legacy(const InputFile& file, const Companions& /*companions*/,
                              const ImportOptions& options) {
  const LegacyHeader header = read_legacy_header(file);
  const auto arrays = vtk_arrays(file, header.bytes, header.is_text);
  std::vector<const VtkArray*> found = scalars_of(arrays, false);
  if (found.empty()) found = scalars_of(arrays, true);
  if (found.empty()) throw_unusable("The VTK file has no array of single numbers.");
  SourceVolume volume;
  const auto title = [&](std::uint64_t index) { return vtk_array_title(found[index]->name); };
  choose_volume(found.size(), {.what = "their array", .title = title}, options, volume);
  const VtkArray* array = found[std::exchange(volume.chosen, {}).index];
  take(*array, header, options, volume);
  volume.payload = {array->offset, file.size() - std::min(file.size(), array->offset)};
  volume.has_footer = true;
  if (header.is_text) {
    volume.encoding = array->is_colors ? Encoding::kFractionText : Encoding::kText;
    volume.payload.bytes = text_bytes(file, array->offset);
  }
  return volume;
}

MostBytes most_vtk_legacy_bytes(const InputFile& beginning, const ImportTask& task) {
  return most_vtk_bytes(volume_dims(read_legacy_header(beginning).points), task);
}

}  // namespace isomesh::import
