#include "server/import/formats/vtk.h"

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <utility>

#include "base/text.h"
#include "server/import/source/line_reader.h"
#include "server/import/source/names.h"
#include "server/import/source/reader.h"

namespace isomesh::import {
namespace {

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

}  // namespace

VtkExtent vtk_extent(std::string_view text, std::string_view name) {
  const auto parts = words(text);
  constexpr std::int64_t kFarthest = std::numeric_limits<std::int32_t>::max();
  VtkExtent extent;
  std::array<std::uint64_t, 3> sizes = {0, 0, 0};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto first = parts.size() == 6 ? parse_int64(parts[axis * 2]) : std::nullopt;
    const auto last = parts.size() == 6 ? parse_int64(parts[axis * 2 + 1]) : std::nullopt;
    if (!first || !last || std::abs(*first) > kFarthest || std::abs(*last) > kFarthest ||
        *last < *first) {
      throw_unusable("The VTK file's " + in_quotes(name) +
                     " is not the first and last index along each of three axes.");
    }
    extent.first[axis] = *first;
    sizes[axis] = static_cast<std::uint64_t>(*last - *first + 1);
  }
  extent.dims = volume_dims(sizes);
  return extent;
}

bool is_vtk_mask(std::string_view name) {
  return name == "vtkGhostType" || name == "vtkValidPointMask";
}

std::string vtk_array_title(std::string_view name) { return "array " + in_quotes(name); }

MostBytes most_vtk_bytes(const std::array<std::uint32_t, 3>& dims, const ImportTask& task) {
  // Per sample, in all arrays together: 32 numbers as text.
  constexpr std::uint64_t kMostPerSample = 1024;
  const std::uint64_t samples = std::uint64_t{dims[0]} * dims[1] * dims[2];
  const std::uint64_t most = task.limits.max_sample_bytes;
  return {.file = std::min(most, std::min(most, samples) * kMostPerSample) + kHeadroomBytes};
}

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

std::vector<VtkArray> vtk_arrays(const InputFile& file, std::uint64_t offset, bool is_text) {
  return Scanner(file, offset, is_text).arrays();
}

}  // namespace isomesh::import
