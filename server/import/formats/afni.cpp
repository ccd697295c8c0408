#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>

#include "base/text.h"
#include "server/import/formats/format_readers.h"
#include "server/import/source/header_fields.h"
#include "server/import/source/line_reader.h"

namespace isomesh::import {
namespace {

// "name = value" of one line; empty if it is none.
std::optional<std::string_view> value_in(std::string_view line, std::string_view name) {
  const std::size_t equals = line.find('=');
  if (equals == std::string_view::npos || trimmed(line.substr(0, equals)) != name) {
    return std::nullopt;
  }
  return trimmed(line.substr(equals + 1));
}

bool is_type(std::string_view line) {
  const auto type = value_in(line, "type");
  return type && (*type == "string-attribute" || *type == "integer-attribute" ||
                  *type == "float-attribute");
}

constexpr std::uint64_t kMostHeadBytes = std::uint64_t{8} << 20;  // statistics have long ones

// Each attribute has three lines, then its value up to the next attribute.
HeaderTexts read_attributes(const InputFile& file) {
  HeaderTexts attributes;
  std::string* value = nullptr;
  LineReader lines(file, {.header = "The AFNI header", .bytes = kMostHeadBytes});
  while (const auto line = lines.next_filled()) {
    if (is_type(*line)) {
      value = nullptr;
    } else if (const auto name = value_in(*line, "name"); name && value == nullptr) {
      value = &attributes[std::string(*name)];
    } else if (value != nullptr && !value_in(*line, "count")) {
      *value += (value->empty() ? "" : "\n") + std::string(*line);
    }
  }
  return attributes;
}

// The value of a string attribute, which is written as 'text~.
std::string_view string_of(const HeaderTexts& attributes, std::string_view name) {
  std::string_view text = value_of(attributes, name);
  if (text.starts_with('\'')) text.remove_prefix(1);
  while (text.ends_with('~')) text.remove_suffix(1);
  return text;
}

std::vector<double> numbers_of(const HeaderTexts& attributes, std::string_view name,
                               std::size_t least) {
  const std::string_view text = value_of(attributes, name);
  std::vector<double> numbers = finite_numbers(text);
  if (numbers.empty() && !text.empty()) {
    throw_unusable("The AFNI attribute " + in_quotes(name) + " is not a list of numbers.");
  }
  if (numbers.size() >= least) return numbers;
  throw_unusable("The AFNI header's attribute " + in_quotes(name) + " has " +
                 std::to_string(numbers.size()) + " numbers instead of " + std::to_string(least) +
                 ".");
}

std::uint64_t whole_value(double number, std::string_view name) {
  return plausible_whole(number, "The AFNI attribute " + in_quotes(name));
}

StoredType type_of(const HeaderTexts& attributes, std::uint64_t volumes) {
  const auto codes = numbers_of(attributes, "BRICK_TYPES", volumes);
  if (std::ranges::count(codes, codes.front()) != static_cast<std::ptrdiff_t>(codes.size())) {
    throw_unusable("The sub-bricks of the AFNI dataset have different types.");
  }
  if (codes.front() == 0) return StoredType::kUint8;
  if (codes.front() == 1) return StoredType::kInt16;
  if (codes.front() == 2) return StoredType::kInt32;
  if (codes.front() == 3) return StoredType::kFloat32;
  if (codes.front() == 4) return StoredType::kFloat64;
  throw_unusable("The AFNI dataset's type " + to_text(codes.front()) +
                 " is not supported. A sample must be one real number.");
}

std::optional<Rescale> rescale_of(const HeaderTexts& attributes, std::uint64_t volume) {
  if (value_of(attributes, "BRICK_FLOAT_FACS").empty()) return std::nullopt;
  const double factor = numbers_of(attributes, "BRICK_FLOAT_FACS", volume + 1)[volume];
  if (factor == 0 || factor == 1) return std::nullopt;  // 0 means none
  return Rescale{factor, 0};
}

// By axis codes: right to left, left to right, back to front, front to back, up, down.
Geometry geometry_of_axes(const HeaderTexts& attributes) {
  const auto codes = numbers_of(attributes, "ORIENT_SPECIFIC", 3);
  const auto origin = numbers_of(attributes, "ORIGIN", 3);
  const auto delta = numbers_of(attributes, "DELTA", 3);
  std::array<Vector3, 3> steps = {};
  Vector3 first = {};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::uint64_t row = whole_value(codes[axis], "ORIENT_SPECIFIC") / 2;
    if (row > 2) throw_unusable("The AFNI attribute \"ORIENT_SPECIFIC\" is not plausible.");
    steps[axis][row] = delta[axis];
    first[row] = origin[axis];
  }
  return geometry_of(first, steps);
}

Geometry geometry_of_header(const HeaderTexts& attributes) {
  if (value_of(attributes, "IJK_TO_DICOM_REAL").empty()) return geometry_of_axes(attributes);
  const auto matrix = numbers_of(attributes, "IJK_TO_DICOM_REAL", 12);
  std::array<Vector3, 3> steps = {};
  Vector3 first = {};
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t axis = 0; axis < 3; ++axis) steps[axis][row] = matrix[row * 4 + axis];
    first[row] = matrix[row * 4 + 3];
  }
  return geometry_of(first, steps);
}

// Everything except the data file.
SourceVolume describe(const HeaderTexts& attributes, const ImportOptions& options) {
  const auto dims = numbers_of(attributes, "DATASET_DIMENSIONS", 3);
  const auto rank = numbers_of(attributes, "DATASET_RANK", 2);
  std::array<std::uint64_t, 4> sizes = {};
  for (std::size_t axis = 0; axis < 3; ++axis)
    sizes[axis] = whole_value(dims[axis], "DATASET_DIMENSIONS");
  sizes[3] = whole_value(rank[1], "DATASET_RANK");
  SourceVolume volume;
  volume.dims = volume_dims(std::span(sizes).first(3));
  const std::uint64_t count = volumes_beyond(sizes);
  const auto names = split(string_of(attributes, "BRICK_LABS"), '~');
  choose_volume(count,
                {.what = "their sub-brick",
                 .title =
                     [&](std::uint64_t index) {
                       const std::string number = "sub-brick " + std::to_string(index);
                       const bool is_named = index < names.size() && !names[index].empty();
                       return is_named ? number + ": " + printable(beginning(names[index], 64))
                                       : number;
                     }},
                options, volume);
  const std::string_view order = string_of(attributes, "BYTEORDER_STRING");
  volume.layout = {type_of(attributes, count), order == "MSB_FIRST",
                   rescale_of(attributes, volume.chosen.index)};
  volume.geometry = geometry_of_header(attributes);
  return volume;
}

std::string brick_name(const Companions& companions) {
  const auto name = companion_with({".BRIK", ".BRIK.gz", ".BRIK.bz2", ".brik", ".brik.gz"},
                                   companions.name(), companions);
  if (name) return *name;
  throw_unusable(
      "The samples of the AFNI header (.HEAD) are in a .BRIK file, which is missing. Send both "
      "files in one ZIP or TAR.");
}

bool is_afni(std::string_view head) {
  const auto first = lines(head.substr(0, std::min<std::size_t>(head.size(), 256)));
  return first.size() >= 2 && is_type(first[0]) && value_in(first[1], "name").has_value();
}

SourceVolume parse_afni(const InputFile& file, const Companions& companions,
                        const ImportOptions& options) {
  const std::string name = brick_name(companions);
  const HeaderTexts attributes = read_attributes(file);
  SourceVolume volume = describe(attributes, options);
  if (name.ends_with(".gz")) volume.encoding = Encoding::kDeflate;
  if (name.ends_with(".bz2")) volume.encoding = Encoding::kBzip2;
  volume.data_files = data_files_of({name}, companions, {}, volume);
  return volume;
}

std::vector<std::string> afni_data_names(const InputFile& /*file*/, const Companions& companions) {
  return {brick_name(companions)};
}

MostBytes most_afni_bytes(const InputFile& beginning, const ImportTask& task) {
  constexpr std::uint64_t kMostFileBytes = kMostHeadBytes + kHeadroomBytes;
  if (beginning.size() >= kBeginningBytes) {  // the rest of the header is not known yet
    return {.file = kMostFileBytes, .data = task.limits.max_sample_bytes + kHeadroomBytes};
  }
  const SourceVolume volume = describe(read_attributes(beginning), task.options);
  check_limits(volume, task.limits);
  return {.file = kMostFileBytes, .data = volume.most_encoded_bytes() + kHeadroomBytes};
}

}  // namespace

constinit const Reader kAfniReader = {.name = "afni",
                                      .sniff = is_afni,
                                      .describe = parse_afni,
                                      .most_bytes = most_afni_bytes,
                                      .data_names = afni_data_names};

}  // namespace isomesh::import
