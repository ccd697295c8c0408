#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/text.h"
#include "server/import/formats/format_readers.h"
#include "server/import/formats/vtk.h"
#include "server/import/source/header_fields.h"
#include "server/import/source/line_reader.h"

namespace isomesh::import {
namespace {

constexpr std::string_view kFirstLine = "# vtk DataFile Version ";
constexpr std::uint64_t kMostLegacyHeaderBytes = std::uint64_t{1} << 16;

// --- Arrays --------------------------------------------------------------------------------------

// An array of a legacy file.
struct VtkArray {
  std::string name;
  std::string type;  // as in the file: "unsigned_char"
  std::uint64_t components = 1;
  std::uint64_t tuples = 0;
  bool is_of_cells = false;
  bool is_scalars = false;   // by the keyword SCALARS
  bool is_colors = false;    // bytes, which text has as fractions of 255
  std::uint64_t offset = 0;  // of its data in the file
};

// Empty for names of no real number.
std::optional<StoredType> vtk_type(const std::string& name) {
  static constexpr std::pair<std::string_view, StoredType> kTypes[] = {
      {"unsigned_char", StoredType::kUint8},
      {"char", StoredType::kInt8},
      {"signed_char", StoredType::kInt8},
      {"unsigned_short", StoredType::kUint16},
      {"short", StoredType::kInt16},
      {"unsigned_int", StoredType::kUint32},
      {"int", StoredType::kInt32},
      {"unsigned_long", StoredType::kUint64},
      {"long", StoredType::kInt64},
      {"vtktypeint64", StoredType::kInt64},
      {"vtktypeuint64", StoredType::kUint64},
      {"vtkidtype", StoredType::kInt32},
      {"float", StoredType::kFloat32},
      {"double", StoredType::kFloat64}};
  const std::string word = lower(name);
  for (const auto& [known, type] : kTypes) {
    if (known == word) return type;
  }
  return std::nullopt;
}

[[noreturn]] void throw_damaged_array() {
  throw_unusable("The VTK file's list of arrays is damaged or truncated.");
}

class Scanner {
 public:
  Scanner(const InputFile& file, std::uint64_t offset, bool is_text)
      : file_bytes_(file.size()),
        lines_(file, {.header = "The VTK file's list of arrays"}, offset),
        is_text_(is_text) {}

  std::vector<VtkArray> arrays();

 private:
  void read_attribute(const std::vector<std::string>& words);
  void read_field(std::uint64_t count);
  void add(VtkArray array);
  void skip(const VtkArray& array);
  void skip_words(std::uint64_t count);
  std::optional<std::vector<std::string>> next_line();
  std::optional<std::vector<std::string>> next_filled_line();
  static std::uint64_t number(const std::string& word);

  const std::uint64_t file_bytes_;
  LineReader lines_;
  const bool is_text_;
  bool is_of_cells_ = false;
  std::uint64_t tuples_ = 0;
  std::vector<VtkArray> arrays_;
};

std::uint64_t Scanner::number(const std::string& word) {
  const auto value = parse_uint64(word);
  if (!value || *value > std::numeric_limits<std::uint32_t>::max()) throw_damaged_array();
  return *value;
}

std::optional<std::vector<std::string>> Scanner::next_line() {
  const auto line = lines_.next();
  if (!line) return std::nullopt;
  const auto parts = words(*line);
  return std::vector<std::string>(parts.begin(), parts.end());
}

std::optional<std::vector<std::string>> Scanner::next_filled_line() {
  for (;;) {
    auto parts = next_line();
    if (!parts || !parts->empty()) return parts;
  }
}

std::vector<VtkArray> Scanner::arrays() {
  for (;;) {
    const auto parts = next_filled_line();
    if (!parts) return std::move(arrays_);
    const std::string keyword = lower(parts->front());
    if (keyword == "metadata") {
      // Lines up to an empty one describe the array before it.
      for (auto line = next_line(); line && !line->empty();) line = next_line();
    } else if (parts->size() < 2) {
      throw_damaged_array();
    } else if (keyword == "point_data" || keyword == "cell_data") {
      is_of_cells_ = keyword == "cell_data";
      tuples_ = number((*parts)[1]);
    } else {
      read_attribute(*parts);
    }
    const bool is_found =
        !arrays_.empty() && arrays_.back().is_scalars && !arrays_.back().is_of_cells;
    if (is_found) return std::move(arrays_);
  }
}

void Scanner::read_attribute(const std::vector<std::string>& parts) {
  const std::string keyword = lower(parts[0]);
  if (keyword == "field") {
    if (parts.size() != 3) throw_damaged_array();
    return read_field(number(parts[2]));
  }
  if (parts.size() < 3) throw_damaged_array();
  VtkArray array{.name = parts[1], .type = parts[2], .tuples = tuples_};
  if (keyword == "scalars") {
    array.is_scalars = true;
    if (parts.size() > 3) array.components = number(parts[3]);
    // The table is named on a line of its own, which some writers leave out.
    const std::uint64_t here = lines_.offset();
    const auto table = next_filled_line();
    if (!table || lower(table->front()) != "lookup_table") lines_.move_to(here);
  } else if (keyword == "vectors" || keyword == "normals") {
    array.components = 3;
  } else if (keyword == "tensors") {
    array.components = 9;
  } else if (keyword == "texture_coordinates" && parts.size() == 4) {
    array.components = number(parts[2]);
    array.type = parts[3];
  } else if (keyword == "color_scalars" || keyword == "lookup_table") {
    const bool is_table = keyword == "lookup_table";
    array.components = is_table ? 4 : number(parts[2]);
    if (is_table) array.tuples = number(parts[2]);
    array.type = "unsigned_char";
    array.is_colors = true;
  } else {
    throw_unusable("The VTK file's keyword " + in_quotes(keyword) + " is unknown.");
  }
  add(std::move(array));
}

void Scanner::read_field(std::uint64_t count) {
  for (std::uint64_t at = 0; at < count; ++at) {
    auto parts = next_filled_line();
    while (parts && lower(parts->front()) == "metadata") {
      for (auto line = next_line(); line && !line->empty();) line = next_line();
      parts = next_filled_line();
    }
    if (!parts || parts->size() != 4) throw_damaged_array();
    add({.name = (*parts)[0],
         .type = (*parts)[3],
         .components = number((*parts)[1]),
         .tuples = number((*parts)[2])});
  }
}

void Scanner::add(VtkArray array) {
  constexpr std::size_t kMostArrays = 1000;
  if (arrays_.size() == kMostArrays) {
    throw_unusable("The VTK file has more than the " + std::to_string(kMostArrays) +
                   " arrays that are supported.");
  }
  array.is_of_cells = is_of_cells_;
  array.offset = lines_.offset();
  arrays_.push_back(array);
  if (!array.is_scalars || array.is_of_cells) skip(array);
}

void Scanner::skip(const VtkArray& array) {
  const std::uint64_t numbers = array.components * array.tuples;
  if (is_text_) return skip_words(numbers);
  const auto type = vtk_type(array.type);
  if (!type) {
    throw_unusable("The VTK file has an array of type " + in_quotes(array.type) +
                   " before its samples, which is not supported.");
  }
  const std::uint64_t bytes = numbers * bytes_per_sample(*type);
  const std::uint64_t left = file_bytes_ - std::min(lines_.offset(), file_bytes_);
  if (numbers > file_bytes_ || bytes > left) throw_damaged_array();
  lines_.move_to(lines_.offset() + bytes);
}

void Scanner::skip_words(std::uint64_t count) {
  bool is_in_word = false;
  while (count > 0 || is_in_word) {
    const std::string_view piece = lines_.view();
    if (piece.empty()) throw_damaged_array();
    std::size_t at = 0;
    for (; at < piece.size() && (count > 0 || is_in_word); ++at) {
      const bool was_in_word = std::exchange(is_in_word, !is_space(piece[at]));
      if (is_in_word && !was_in_word) --count;
    }
    lines_.drop(at);
  }
}

// The arrays from `offset` on, in their order, up to the first scalars of points. Throws Error
// kUnusableVolume if the file is damaged or has more than a thousand of them.
std::vector<VtkArray> vtk_arrays(const InputFile& file, std::uint64_t offset, bool is_text) {
  return Scanner(file, offset, is_text).arrays();
}

// --- The image -----------------------------------------------------------------------------------

struct LegacyHeader {
  bool is_text = false;
  std::array<std::uint64_t, 3> points = {0, 0, 0};
  std::array<std::int64_t, 3> first = {0, 0, 0};  // the index of the first point
  std::optional<Vector3> spacing;
  Vector3 origin = {0, 0, 0};
  std::uint64_t bytes = 0;  // up to the first line of data
};

Vector3 numbers_of(std::string_view text, std::string_view keyword) {
  const auto numbers = finite_numbers(text);
  if (numbers.size() == 3) return {numbers[0], numbers[1], numbers[2]};
  throw_unusable("The VTK file's " + in_quotes(keyword) + " is not three finite numbers.");
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
  const std::string_view values = line.substr(keyword.size());
  if (keyword == "dimensions") header.points = sizes_of(parts);
  if (keyword == "extent") {
    const VtkExtent extent = vtk_extent(values, parts[0]);
    std::ranges::copy(extent.dims, header.points.begin());
    header.first = extent.first;
  }
  if (keyword == "spacing" || keyword == "aspect_ratio") {
    header.spacing = numbers_of(values, parts[0]);
  }
  if (keyword == "origin") header.origin = numbers_of(values, parts[0]);
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
  volume.payload = range_from(file, array->offset);
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

}  // namespace

constinit const Reader kVtkLegacyReader = {.name = "vtk",
                                           .sniff = is_vtk_legacy,
                                           .may_hold_volume = may_hold_structured_points,
                                           .describe = parse_vtk_legacy,
                                           .most_bytes = most_vtk_legacy_bytes};

}  // namespace isomesh::import
