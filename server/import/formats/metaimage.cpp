#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/files.h"
#include "base/text.h"
#include "server/import/formats/file_pattern.h"
#include "server/import/formats/format_readers.h"
#include "server/import/source/header_fields.h"
#include "server/import/source/line_reader.h"
#include "server/import/source/reader.h"
#include "server/import/source/source.h"
#include "server/import/source/units.h"

namespace isomesh::import {
namespace {

constexpr std::string_view kMetaImageTitle = "The MetaImage header";
constexpr std::string_view kLastKey = "ElementDataFile";

struct MetaHeader {
  HeaderTexts fields;
  std::uint64_t bytes = 0;  // including its last line
};

// A MetaImage may begin with any of these keys. The "=" distinguishes them from other text.
bool is_header_line(std::string_view line) {
  static constexpr std::string_view kKeys[] = {"ObjectType", "ObjectSubType", "Comment",
                                               "NDims",      "DimSize",       "ElementType"};
  const std::size_t equals = line.find('=');
  if (equals == std::string_view::npos) return false;
  const std::string_view key = trimmed(line.substr(0, equals));
  return std::find(std::begin(kKeys), std::end(kKeys), key) != std::end(kKeys);
}

void add_line(HeaderTexts& fields, std::string_view line) {
  const std::size_t equals = line.find('=');
  if (equals == std::string_view::npos) {
    throw_unusable("The MetaImage header has a line that is not a field: " + in_quotes(line) + ".");
  }
  add_field(fields, kMetaImageTitle, std::string(trimmed(line.substr(0, equals))),
            trimmed(line.substr(equals + 1)));
}

MetaHeader read_meta_header(const InputFile& file) {
  MetaHeader header;
  LineReader lines(file, {.header = kMetaImageTitle});
  while (const auto line = lines.next_filled()) {
    add_line(header.fields, *line);
    if (header.fields.contains(kLastKey)) {
      header.bytes = lines.offset();
      return header;
    }
  }
  throw_unusable("The MetaImage header has no end: the field \"ElementDataFile\" is missing.");
}

bool flag(const HeaderTexts& fields, std::string_view name, bool otherwise) {
  const std::string value = lower(value_of(fields, name));
  if (value.empty()) return otherwise;
  if (value == "true" || value == "1") return true;
  if (value == "false" || value == "0") return false;
  throw_unusable("The MetaImage header's " + in_quotes(name) + " is not True or False.");
}

bool is_detached(const HeaderTexts& fields) { return lower(value_of(fields, kLastKey)) != "local"; }

// A pattern without its last number, or without any, counts the last axis, from 1.
std::string whole_pattern(std::string_view said, const HeaderTexts& fields) {
  constexpr std::uint64_t kMost = std::numeric_limits<std::int32_t>::max();
  const auto parts = words(said);
  const auto sizes = words(value_of(fields, "DimSize"));
  if (parts.size() > 2 || sizes.empty()) return std::string(said);
  const auto first = parts.size() == 2 ? parse_uint64(parts[1]) : std::optional<std::uint64_t>(1);
  const auto count = parse_uint64(sizes.back());
  if (!first || !count || std::max(*first, *count) > kMost) return std::string(said);
  return std::string(parts[0]) + ' ' + std::to_string(*first) + ' ' +
         std::to_string(*first + *count - 1);
}

// The names of the data files. After "LIST" they follow the header, one per line.
std::vector<std::string> data_names(const InputFile& file, const MetaHeader& header) {
  const std::string_view said = value_of(header.fields, kLastKey);
  if (is_file_pattern(said)) return expand_file_pattern(whole_pattern(said, header.fields));
  if (!said.starts_with("LIST")) return {std::string(said)};
  LineReader lines(file, {.header = "The MetaImage header's list of files"}, header.bytes);
  return rest_of(lines);
}

Skip data_skip(const HeaderTexts& fields) {
  const std::string_view text = value_of(fields, "HeaderSize");
  if (text.empty()) return 0;
  const auto bytes = parse_int64(text);
  if (!bytes || *bytes < -1) {
    throw_unusable("The MetaImage header's \"HeaderSize\" is " + in_quotes(text) +
                   ", not a number of bytes or -1.");
  }
  if (*bytes < 0) return std::nullopt;
  return static_cast<std::uint64_t>(*bytes);
}

std::vector<std::uint64_t> sizes_of(const HeaderTexts& fields) {
  constexpr std::uint64_t kMostAxes = 10;
  return required_sizes(fields, kMetaImageTitle, "NDims", "DimSize", kMostAxes);
}

StoredType type_of(const HeaderTexts& fields) {
  struct Row {
    std::string_view name;
    StoredType type;
  };
  // MetaIO's long is 4 bytes on every machine.
  static constexpr Row kTypes[] = {
      {"MET_CHAR", StoredType::kInt8},       {"MET_UCHAR", StoredType::kUint8},
      {"MET_SHORT", StoredType::kInt16},     {"MET_USHORT", StoredType::kUint16},
      {"MET_INT", StoredType::kInt32},       {"MET_UINT", StoredType::kUint32},
      {"MET_LONG", StoredType::kInt32},      {"MET_ULONG", StoredType::kUint32},
      {"MET_LONG_LONG", StoredType::kInt64}, {"MET_ULONG_LONG", StoredType::kUint64},
      {"MET_FLOAT", StoredType::kFloat32},   {"MET_DOUBLE", StoredType::kFloat64},
  };
  const std::string_view name = required(fields, kMetaImageTitle, "ElementType");
  for (const Row& row : kTypes) {
    if (row.name == name) return row.type;
  }
  throw_unusable("The MetaImage header's ElementType " + in_quotes(name) +
                 " is not supported. A sample must be one real number.");
}

void check_samples_are_plain(const HeaderTexts& fields) {
  const std::string_view channels = value_of(fields, "ElementNumberOfChannels");
  if (!channels.empty() && parse_uint64(channels) != 1) {
    throw_unusable("Each sample has " + in_quotes(channels) +
                   " channels. A sample must be one real number.");
  }
}

// The standard's function from elements to intensities; few programs apply it.
std::optional<Rescale> rescale_of(const HeaderTexts& fields) {
  const auto number = [&](std::string_view name, double otherwise) {
    const std::string_view text = value_of(fields, name);
    if (text.empty()) return otherwise;
    const auto value = finite_number(text);
    if (!value) {
      throw_unusable("The MetaImage header's " + in_quotes(name) + " is not a finite number.");
    }
    return *value;
  };
  const Rescale rescale = {number("ElementToIntensityFunctionSlope", 1),
                           number("ElementToIntensityFunctionOffset", 0)};
  if (rescale.slope == 0) throw_unusable("The MetaImage header's slope for its samples is 0.");
  if (rescale.slope == 1 && rescale.intercept == 0) return std::nullopt;
  return rescale;
}

bool is_big_endian(const HeaderTexts& fields, StoredType type) {
  const bool of_data = flag(fields, "BinaryDataByteOrderMSB", false);
  const bool of_elements = flag(fields, "ElementByteOrderMSB", of_data);
  const bool has_both = !value_of(fields, "BinaryDataByteOrderMSB").empty();
  if (of_elements != of_data && has_both && bytes_per_sample(type) > 1) {
    throw_unusable(
        "The MetaImage header contradicts itself: \"ElementByteOrderMSB\" differs from "
        "\"BinaryDataByteOrderMSB\", which has the same meaning.");
  }
  return of_elements;
}

Encoding encoding_of(const HeaderTexts& fields) {
  const bool compressed = flag(fields, "CompressedData", false);
  if (flag(fields, "BinaryData", true)) return compressed ? Encoding::kDeflate : Encoding::kRaw;
  if (compressed)
    throw_unusable("The MetaImage header contradicts itself: its samples are text and compressed.");
  return Encoding::kText;
}

CompressedRange payload_of(const InputFile& file, const MetaHeader& header,
                           const SourceVolume& volume) {
  CompressedRange payload{header.bytes, file.size() - header.bytes};
  const std::string_view skip = value_of(header.fields, "HeaderSize");
  if (!skip.empty() && parse_int64(skip) != 0) {
    throw_unusable("The MetaImage header has a HeaderSize, but its samples are in the same file.");
  }
  const std::string_view size = value_of(header.fields, "CompressedDataSize");
  if (size.empty() || volume.encoding != Encoding::kDeflate) return payload;
  const auto bytes = parse_uint64(size);
  if (!bytes) throw_unusable("The MetaImage header's \"CompressedDataSize\" is not a number.");
  if (*bytes > payload.bytes) {
    throw_unusable("The file is truncated: its header declares " + std::to_string(*bytes) +
                   " bytes of compressed data, but the file has " + std::to_string(payload.bytes) +
                   ".");
  }
  payload.bytes = *bytes;
  return payload;
}

void check_numbers(const HeaderTexts& fields, std::string_view name, std::size_t count) {
  const std::string_view value = value_of(fields, name);
  if (value.empty()) return;
  if (finite_numbers(value).size() == count) return;
  throw_unusable("The MetaImage header's " + in_quotes(name) + " is not " + std::to_string(count) +
                 " finite numbers.");
}

// The value of a field with several names. Throws if they contradict each other.
std::string_view one_of(const HeaderTexts& fields, std::initializer_list<std::string_view> names,
                        std::size_t count) {
  std::string_view result;
  for (const std::string_view name : names) {
    check_numbers(fields, name, count);
    const std::string_view value = value_of(fields, name);
    if (value.empty()) continue;
    if (!result.empty() && words(result) != words(value)) {
      throw_unusable("The MetaImage header contradicts itself: " + in_quotes(name) +
                     " differs from another field with the same meaning.");
    }
    result = value;
  }
  return result;
}

// MetaImage's space is LPS, as in all programs that write it. Axes beyond the third are omitted.
Geometry geometry_of_fields(const HeaderTexts& fields, std::size_t axes) {
  const auto matrix =
      finite_numbers(one_of(fields, {"TransformMatrix", "Rotation", "Orientation"}, axes * axes));
  const auto origin = finite_numbers(one_of(fields, {"Offset", "Position", "Origin"}, axes));
  // ElementSize is the extent of a sample. It replaces a missing ElementSpacing.
  check_numbers(fields, "ElementSize", axes);
  const std::string_view distances = one_of(fields, {"ElementSpacing"}, axes);
  const auto spacing =
      finite_numbers(distances.empty() ? value_of(fields, "ElementSize") : distances);
  Geometry geometry;
  const std::size_t used = std::min<std::size_t>(axes, 3);
  std::copy_n(origin.begin(), std::min(used, origin.size()), geometry.origin.begin());
  std::copy_n(spacing.begin(), std::min(used, spacing.size()), geometry.spacing.begin());
  // The matrix has a row per axis, a geometry a column.
  for (std::size_t axis = 0; axis < used && !matrix.empty(); ++axis) {
    for (std::size_t row = 0; row < used; ++row) {
      geometry.direction[row * 3 + axis] = matrix[axis * axes + row];
    }
  }
  return geometry;
}

// A frame's timestamp, as the trackers of PLUS and Slicer's sequences write it; empty if missing.
std::string timestamp_of(const HeaderTexts& fields, std::uint64_t frame) {
  std::string number = std::to_string(frame);
  number.insert(0, 4 - std::min<std::size_t>(number.size(), 4), '0');
  const auto seconds = parse_double(value_of(fields, "Seq_Frame" + number + "_Timestamp"));
  return seconds ? "time " + to_text(*seconds) + " s" : std::string();
}

// A volume's position along the axes beyond the third, of which the fourth runs fastest. Its index
// if the header has neither an origin nor a spacing for a single such axis.
std::string place_of(const HeaderTexts& fields, std::span<const std::uint64_t> sizes,
                     std::uint64_t index) {
  const auto spacing = finite_numbers(one_of(fields, {"ElementSpacing"}, sizes.size()));
  const auto origin =
      finite_numbers(one_of(fields, {"Offset", "Position", "Origin"}, sizes.size()));
  std::string place;
  std::uint64_t rest = index;
  for (std::size_t axis = 3; axis < sizes.size(); ++axis) {
    const auto at = static_cast<double>(rest % sizes[axis]);
    rest /= sizes[axis];
    const double step = spacing.empty() ? 1 : spacing[axis];
    const double first = origin.empty() ? 0 : origin[axis];
    if (sizes.size() == 4 && step == 1 && first == 0) return "volume " + std::to_string(index);
    if (sizes[axis] == 1) continue;
    place += (place.empty() ? "axis " : ", axis ") + std::to_string(axis + 1) + " at " +
             to_text(first + step * at);
  }
  return place;
}

Difference difference_of(const HeaderTexts& fields, const std::vector<std::uint64_t>& sizes) {
  if (!timestamp_of(fields, 0).empty()) {
    return {.what = "time", .title = [&](std::uint64_t index) {
              const std::string time = timestamp_of(fields, index);
              return time.empty() ? "volume " + std::to_string(index) : time;
            }};
  }
  const bool is_fourth = sizes.size() <= 4;
  return {.what = is_fourth ? "their place along the fourth axis"
                            : "their place along the axes beyond the third",
          .title = [&](std::uint64_t index) { return place_of(fields, sizes, index); }};
}

// PLUS and 3D Slicer write tracked ultrasound so: one of the three axes counts images. Older
// versions only add a field for each image.
bool are_frames(const HeaderTexts& fields) {
  const std::string lowered = lower(value_of(fields, "Kinds"));
  const auto kinds = words(lowered);
  return std::ranges::any_of(kinds, [](auto kind) { return kind == "list" || kind == "time"; }) ||
         std::ranges::any_of(
             fields, [](const auto& field) { return field.first.starts_with("Seq_Frame"); });
}

std::string frames_axis(const HeaderTexts& fields, std::size_t axes) {
  const std::string kinds = lower(value_of(fields, "Kinds"));
  if (kinds.find("time") != std::string::npos) return "its axis of time";
  if (kinds.find("list") != std::string::npos) return "its axis of a list";
  if (axes > 4) return "its axes beyond the third";
  return axes == 4 ? "its fourth axis"
                   : "its third axis, with a time or place for each (Seq_Frame)";
}

// Sets dims, type and encoding, and selects one of several volumes.
SourceVolume samples_of(const HeaderTexts& fields, const std::vector<std::uint64_t>& sizes,
                        const ImportOptions& options) {
  SourceVolume volume;
  volume.dims = volume_dims(std::span(sizes).first(std::min<std::size_t>(sizes.size(), 3)));
  volume.encoding = encoding_of(fields);
  volume.layout.type = type_of(fields);
  volume.layout.big_endian = is_big_endian(fields, volume.layout.type);
  volume.layout.rescale = rescale_of(fields);
  if (volume.layout.rescale) {
    volume.notes.push_back(
        note_of(NoteCode::kValuesRescaled,
                "The samples were changed by the slope and offset of the MetaImage header. "
                "Programs that ignore these show other values."));
  }
  const std::string axis = frames_axis(fields, sizes.size());
  if (sizes.size() == 3 && are_frames(fields)) accept_frames(sizes[2], axis, options, volume);
  const std::uint64_t volumes = volumes_of_frames(volumes_beyond(sizes), axis, options, volume);
  choose_volume(volumes, difference_of(fields, sizes), options, volume);
  return volume;
}

bool is_metaimage(std::string_view head) {
  const std::size_t end = head.find('\n');
  return end != std::string_view::npos && is_header_line(head.substr(0, end));
}

std::vector<std::string> metaimage_data_names(const InputFile& file,
                                              const Companions& /*companions*/) {
  const MetaHeader header = read_meta_header(file);
  return is_detached(header.fields) ? data_names(file, header) : std::vector<std::string>();
}

SourceVolume parse_metaimage(const InputFile& file, const Companions& companions,
                             const ImportOptions& options) {
  const MetaHeader header = read_meta_header(file);
  const HeaderTexts& fields = header.fields;
  const std::string_view object = value_of(fields, "ObjectType");
  if (!object.empty() && object != "Image") {
    throw_unusable("The file holds a MetaIO " + in_quotes(object) + ", not an image.");
  }
  const std::vector<std::uint64_t> sizes = sizes_of(fields);
  check_samples_are_plain(fields);
  SourceVolume volume = samples_of(fields, sizes, options);
  if (is_detached(fields)) {
    volume.data_files =
        data_files_of(data_names(file, header), companions, {.bytes = data_skip(fields)}, volume);
  } else {
    volume.payload = payload_of(file, header, volume);
  }
  volume.geometry = geometry_of_fields(fields, sizes.size());
  volume.assumes_spacing =
      value_of(fields, "ElementSpacing").empty() && value_of(fields, "ElementSize").empty();
  scale_to_millimetres(value_of(fields, "DistanceUnits"), volume);
  return volume;
}

MostBytes most_metaimage_bytes(const InputFile& beginning, const ImportTask& task) {
  constexpr std::uint64_t kMostSkipped = std::uint64_t{64} << 20;
  const MetaHeader header = read_meta_header(beginning);
  const HeaderTexts& fields = header.fields;
  const SourceVolume volume = samples_of(fields, sizes_of(fields), task.options);
  check_limits(volume, task.limits);
  const std::uint64_t samples = volume.most_encoded_bytes() + kHeadroomBytes;
  if (!is_detached(fields)) return {.file = header.bytes + samples};
  const std::uint64_t skipped = std::min(data_skip(fields).value_or(kMostSkipped), kMostSkipped);
  return {.file = kMostTextHeaderBytes + kHeadroomBytes, .data = skipped + samples};
}

}  // namespace

constinit const Reader kMetaImageReader = {.name = "metaimage",
                                           .sniff = is_metaimage,
                                           .describe = parse_metaimage,
                                           .most_bytes = most_metaimage_bytes,
                                           .data_names = metaimage_data_names};

}  // namespace isomesh::import
