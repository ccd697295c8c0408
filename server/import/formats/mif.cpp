#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/text.h"
#include "server/import/formats/format_readers.h"
#include "server/import/formats/placing.h"
#include "server/import/limits.h"
#include "server/import/source/header_fields.h"
#include "server/import/source/line_reader.h"

namespace isomesh::import {
namespace {

constexpr std::string_view kMifTitle = "The MIF header";
constexpr std::size_t kMostMifAxes = 16;

// The lines "key: value"; `transform` has three of them, and `file` one for each data file.
struct MifHeader {
  HeaderTexts fields;
  std::vector<std::vector<double>> transform;
  std::vector<std::string> files;
};

std::vector<std::string_view> parts_of(std::string_view text) {
  std::vector<std::string_view> parts;
  while (!text.empty()) {
    const std::size_t comma = std::min(text.find(','), text.size());
    parts.push_back(trimmed(text.substr(0, comma)));
    text.remove_prefix(std::min(comma + 1, text.size()));
  }
  return parts;
}

bool is_mif(std::string_view head) {
  return head.starts_with("mrtrix image\n") || head.starts_with("mrtrix image\r\n");
}

MifHeader read_mif_header(const InputFile& file) {
  LineReader lines(file, {.header = kMifTitle});
  MifHeader header;
  lines.next();
  while (const auto line = lines.next_filled()) {
    if (*line == "END") return header;
    const std::size_t colon = line->find(':');
    if (colon == std::string_view::npos) continue;
    const std::string name = lower(trimmed(line->substr(0, colon)));
    const std::string_view value = trimmed(line->substr(colon + 1));
    if (name == "transform") {
      header.transform.push_back(finite_numbers_of(parts_of(value)));
    } else if (name == "file") {
      header.files.emplace_back(value);
    } else if (name == "dim" || name == "vox" || name == "layout" || name == "datatype" ||
               name == "scaling") {
      add_field(header.fields, kMifTitle, name, value);
    }
  }
  throw_unusable("The MIF header has no end.");
}

void set_type(std::string_view name, SourceVolume& volume) {
  struct Row {
    std::string_view name;
    StoredType type;
    Encoding encoding = Encoding::kRaw;
  };
  static constexpr Row kTypes[] = {{"bit", StoredType::kUint8, Encoding::kBits},
                                   {"int8", StoredType::kInt8},
                                   {"uint8", StoredType::kUint8},
                                   {"int16", StoredType::kInt16},
                                   {"uint16", StoredType::kUint16},
                                   {"int32", StoredType::kInt32},
                                   {"uint32", StoredType::kUint32},
                                   {"int64", StoredType::kInt64},
                                   {"uint64", StoredType::kUint64},
                                   {"float16", StoredType::kFloat32, Encoding::kHalf},
                                   {"float32", StoredType::kFloat32},
                                   {"float64", StoredType::kFloat64}};
  const std::string found = lower(name);
  std::string_view plain = found;
  const bool big_endian = plain.ends_with("be");
  if (big_endian || plain.ends_with("le")) plain.remove_suffix(2);
  const auto* row = std::ranges::find(kTypes, plain, &Row::name);
  if (row == std::end(kTypes)) {
    throw_unusable("The MIF file's datatype " + in_quotes(name) +
                   " is not supported. Convert it, for example with mrconvert -datatype float32.");
  }
  volume.layout = {row->type, big_endian, std::nullopt};
  volume.encoding = row->encoding;
}

// An axis as it is stored: 0 varies fastest.
struct StoredAxis {
  std::size_t rank = 0;
  bool is_reversed = false;
};

std::vector<StoredAxis> axes_of(const MifHeader& header, std::size_t count) {
  std::vector<StoredAxis> axes;
  std::vector<bool> seen(count);
  for (std::string_view part : parts_of(required(header.fields, kMifTitle, "layout"))) {
    StoredAxis axis = {.is_reversed = part.starts_with('-')};
    if (part.starts_with('-') || part.starts_with('+')) part.remove_prefix(1);
    const auto rank = parse_uint64(part);
    if (!rank || *rank >= count || seen[*rank])
      throw_unusable("The MIF header's layout is damaged.");
    seen[*rank] = true;
    axis.rank = *rank;
    axes.push_back(axis);
  }
  if (axes.size() != count) throw_unusable("The MIF header's layout does not fit its dim.");
  return axes;
}

std::vector<std::uint64_t> mif_sizes(const MifHeader& header) {
  std::vector<std::uint64_t> sizes;
  for (const std::string_view part : parts_of(required(header.fields, kMifTitle, "dim"))) {
    const auto size = parse_uint64(part);
    if (!size || *size == 0 || *size > 1'000'000'000) {
      throw_unusable("The MIF header's dim is not plausible.");
    }
    sizes.push_back(*size);
  }
  if (sizes.size() < 3 || sizes.size() > kMostMifAxes) {
    throw_unusable("The MIF file has " + std::to_string(sizes.size()) +
                   " axes. Files of 3 and 4 axes can be read.");
  }
  return sizes;
}

// Volumes lie along one axis, which may vary at any speed.
void choose_mif_volume(const std::vector<std::uint64_t>& sizes, const std::vector<StoredAxis>& axes,
                       const ImportOptions& options, SourceVolume& volume) {
  const auto is_long = [](std::uint64_t size) { return size > 1; };
  const std::span beyond = std::span(sizes).subspan(3);
  if (std::ranges::count_if(beyond, is_long) > 1) {
    throw_unusable(
        "The MIF file has several axes beyond space, of which one is supported. Extract a part of "
        "it, for example the first volumes of the fifth axis with mrconvert IN -coord 4 0 OUT.");
  }
  const std::uint64_t count = volumes_beyond(sizes);
  const auto axis =
      static_cast<std::size_t>(std::ranges::find_if(beyond, is_long) - beyond.begin()) + 3;
  choose_volume(count, numbered("their axis beyond space", "volume"), options, volume);
  if (axis == sizes.size()) return;
  std::uint64_t run = 1;
  for (std::size_t other = 0; other < sizes.size(); ++other) {
    if (axes[other].rank < axes[axis].rank) run *= sizes[other];
  }
  if (run != volume.sample_count()) volume.chosen.run = run;
  if (axes[axis].is_reversed) volume.chosen.index = count - 1 - volume.chosen.index;
}

// Coordinates are RAS; a reversed axis begins at its other end. If there is no transform, MRtrix
// takes the axes for those of RAS, and centres the image.
Geometry mif_geometry(const MifHeader& header, const std::vector<StoredAxis>& axes,
                      SourceVolume& volume) {
  std::array<Vector3, 3> steps = {Vector3{1, 0, 0}, Vector3{0, 1, 0}, Vector3{0, 0, 1}};
  Vector3 origin = {0, 0, 0};
  const std::size_t lines = header.transform.size();
  if (lines == 1 || lines == 2) {
    throw_unusable("The MIF header's transform has " + std::to_string(lines) +
                   (lines == 1 ? " line" : " lines") + " of three. Write the file again.");
  }
  for (std::size_t row = 0; row < 3 && lines > 0; ++row) {
    if (header.transform[row].size() != 4) throw_unusable("The MIF header's transform is damaged.");
    for (std::size_t axis = 0; axis < 3; ++axis) steps[axis][row] = header.transform[row][axis];
    origin[row] = header.transform[row][3];
  }
  if (lines == 0) {
    volume.notes.push_back(note_of(NoteCode::kSpaceAssumed,
                                   "The MIF file has no transform. Its axes x, y and z were read "
                                   "as those of RAS, with (0,0,0) in the middle, as in MRtrix."));
  }
  const std::vector<std::string_view> sizes = parts_of(required(header.fields, kMifTitle, "vox"));
  if (sizes.size() < 3) throw_unusable("The MIF header's vox is damaged.");
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto size = finite_number(sizes[axis]);
    if (!size) throw_unusable("The MIF header's vox is damaged.");
    for (std::size_t row = 0; row < 3; ++row) {
      steps[axis][row] *= *size;
      if (lines == 0) origin[row] -= steps[axis][row] * (volume.dims[axis] - 1) / 2;
      if (!axes[axis].is_reversed) continue;
      origin[row] += steps[axis][row] * (volume.dims[axis] - 1);
      steps[axis][row] = -steps[axis][row];
    }
  }
  return geometry_of_ras(origin, steps);
}

SourceVolume described(const MifHeader& header, const ImportOptions& options) {
  const std::vector<std::uint64_t> sizes = mif_sizes(header);
  const std::vector<StoredAxis> axes = axes_of(header, sizes.size());
  SourceVolume volume;
  volume.dims = volume_dims(std::span(sizes).first(3));
  set_type(required(header.fields, kMifTitle, "datatype"), volume);
  const std::string_view scaling = value_of(header.fields, "scaling");
  if (!scaling.empty()) {
    const std::vector<double> numbers = finite_numbers_of(parts_of(scaling));
    if (numbers.size() != 2) throw_unusable("The MIF header's scaling is damaged.");
    if (numbers[0] != 0 || numbers[1] != 1) {
      volume.layout.rescale = Rescale{.slope = numbers[1], .intercept = numbers[0]};
    }
  }
  std::array<std::size_t, 3> order = kXFastest;
  std::ranges::sort(order, {}, [&](std::size_t axis) { return axes[axis].rank; });
  volume.storage_order = order;
  choose_mif_volume(sizes, axes, options, volume);
  volume.geometry = mif_geometry(header, axes, volume);
  return volume;
}

// "name offset"; the name "." is the header's own file.
struct MifData {
  std::string name;
  std::uint64_t offset = 0;
};

std::vector<MifData> data_of(const MifHeader& header) {
  std::vector<MifData> data;
  for (const std::string& file : header.files) {
    const std::size_t space = file.rfind(' ');
    const auto offset =
        space == std::string::npos ? std::nullopt : parse_uint64(file.substr(space + 1));
    data.push_back({offset ? std::string(trimmed(std::string_view(file).substr(0, space))) : file,
                    offset.value_or(0)});
  }
  if (data.empty()) throw_unusable("The MIF header names no file of samples.");
  if (std::ranges::any_of(data, [&](const MifData& each) {
        return each.offset != data[0].offset || (each.name == ".") != (data[0].name == ".");
      })) {
    throw_unusable("The MIF header's files of samples have different offsets.");
  }
  return data;
}

std::vector<std::string> names_of(const std::vector<MifData>& data) {
  std::vector<std::string> names;
  for (const MifData& each : data) {
    if (each.name != ".") names.push_back(each.name);
  }
  return names;
}

std::vector<std::string> mif_data_names(const InputFile& file, const Companions& /*companions*/) {
  return names_of(data_of(read_mif_header(file)));
}

SourceVolume parse_mif(const InputFile& file, const Companions& companions,
                       const ImportOptions& options) {
  const MifHeader header = read_mif_header(file);
  const std::vector<MifData> data = data_of(header);
  SourceVolume volume = described(header, options);
  if (data.front().name == ".") {
    volume.payload = range_from(file, data.front().offset);
  } else {
    volume.data_files =
        data_files_of(names_of(data), companions, {.bytes = data.front().offset}, volume);
  }
  return volume;
}

MostBytes most_mif_bytes(const InputFile& beginning, const ImportTask& task) {
  constexpr std::uint64_t kMostSkipped = std::uint64_t{64} << 20;
  const MifHeader header = read_mif_header(beginning);
  const SourceVolume volume = described(header, task.options);
  check_limits(volume, task.limits);
  const MifData data = data_of(header).front();
  const std::uint64_t samples =
      std::min(data.offset, kMostSkipped) + volume.most_encoded_bytes() + kHeadroomBytes;
  if (data.name == ".") return {.file = samples};
  return {.file = limits::kMostTextHeaderBytes + kHeadroomBytes, .data = samples};
}

}  // namespace

constinit const Reader kMifReader = {.name = "mif",
                                     .sniff = is_mif,
                                     .describe = parse_mif,
                                     .most_bytes = most_mif_bytes,
                                     .data_names = mif_data_names};

}  // namespace isomesh::import
