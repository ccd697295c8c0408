#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/files.h"
#include "base/text.h"
#include "proto/samples.h"
#include "server/import/formats/file_pattern.h"
#include "server/import/formats/format_readers.h"
#include "server/import/formats/nrrd_segments.h"
#include "server/import/formats/nrrd_space.h"
#include "server/import/source/line_reader.h"
#include "server/import/source/reader.h"
#include "server/import/source/units.h"

namespace isomesh::import {
namespace {

constexpr std::string_view kNrrdTitle = "The NRRD header";
constexpr std::string_view kDataFile = "datafile";

struct NrrdHeader {
  NrrdFields fields;
  std::uint64_t bytes = 0;  // including the final empty line
};

std::string field_name(std::string_view text) {
  std::string name = lower(trimmed(text));
  std::erase(name, ' ');
  if (name == "centerings") return "centers";
  return name;
}

void add_nrrd_line(NrrdFields& fields, std::string_view line) {
  const std::size_t colon = line.find(':');
  if (colon == std::string_view::npos) {
    throw_unusable("The NRRD header has a line that is not a field: " + in_quotes(line) + ".");
  }
  // "key:=value" is private to a program; its key may equal a field's name, or have colons.
  const std::size_t equals = line.find(":=");
  if (equals < line.find(": ")) {
    fields.emplace(own_key(line.substr(0, equals)), trimmed(line.substr(equals + 2)));
    return;
  }
  const std::string name = field_name(line.substr(0, colon));
  add_field(fields, kNrrdTitle, name, trimmed(line.substr(colon + 1)));
}

bool names_list(const NrrdFields& fields) {
  const auto found = fields.find(kDataFile);
  return found != fields.end() && found->second.starts_with("LIST");
}

NrrdHeader read_nrrd_header(const InputFile& file) {
  NrrdHeader header;
  LineReader lines(file, {.header = kNrrdTitle});
  for (bool first = true;; first = false) {
    header.bytes = lines.offset();
    // Only a detached header may end with its file.
    auto line = names_list(header.fields) ? std::nullopt : lines.next_ended();
    if (!line) {
      if (header.fields.contains(kDataFile)) return header;
      break;
    }
    if (line->ends_with('\r')) line->remove_suffix(1);
    if (line->empty()) {
      header.bytes = lines.offset();
      return header;
    }
    if (!first && !line->starts_with('#')) add_nrrd_line(header.fields, *line);
  }
  throw_unusable("The NRRD header has no end: the empty line after it is missing.");
}

StoredType nrrd_type(const NrrdFields& fields) {
  using Names = std::vector<std::string_view>;
  static const std::vector<std::pair<StoredType, Names>> types = {
      {StoredType::kInt8, {"signed char", "int8", "int8_t"}},
      {StoredType::kUint8, {"uchar", "unsigned char", "uint8", "uint8_t"}},
      {StoredType::kInt16,
       {"short", "short int", "signed short", "signed short int", "int16", "int16_t"}},
      {StoredType::kUint16,
       {"ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"}},
      {StoredType::kInt32, {"int", "signed int", "int32", "int32_t"}},
      {StoredType::kUint32, {"uint", "unsigned int", "uint32", "uint32_t"}},
      {StoredType::kInt64,
       {"longlong", "long long", "long long int", "signed long long", "signed long long int",
        "int64", "int64_t"}},
      {StoredType::kUint64,
       {"ulonglong", "unsigned long long", "unsigned long long int", "uint64", "uint64_t"}},
      {StoredType::kFloat32, {"float"}},
      {StoredType::kFloat64, {"double"}}};
  const std::string name = lower(required(fields, kNrrdTitle, "type"));
  for (const auto& [type, names] : types) {
    if (std::find(names.begin(), names.end(), name) != names.end()) return type;
  }
  throw_unusable("The NRRD header's type " + in_quotes(name) +
                 " is not supported. A sample must be one real number.");
}

std::vector<std::uint64_t> axis_sizes(const NrrdFields& fields) {
  constexpr std::uint64_t kMostAxes = 16;
  return required_sizes(fields, kNrrdTitle, "dimension", "sizes", kMostAxes);
}

Encoding payload_encoding(const NrrdFields& fields) {
  const std::string name = lower(required(fields, kNrrdTitle, "encoding"));
  if (name == "raw") return Encoding::kRaw;
  if (name == "gzip" || name == "gz") return Encoding::kDeflate;
  if (name == "text" || name == "txt" || name == "ascii") return Encoding::kText;
  if (name == "hex") return Encoding::kHex;
  if (name == "bzip2" || name == "bz2") return Encoding::kBzip2;
  throw_unusable("The NRRD header's encoding " + in_quotes(name) +
                 " is not supported. raw, gzip, bzip2, ascii and hex are.");
}

bool is_big_endian(const NrrdFields& fields, StoredType type, Encoding encoding) {
  const std::string name = lower(value_of(fields, "endian"));
  if (name == "little") return false;
  if (name == "big") return true;
  if (!name.empty()) throw_unusable("The NRRD header's endian " + in_quotes(name) + " is unknown.");
  if (bytes_per_sample(type) > 1 && encoding != Encoding::kText) {
    throw_unusable("The NRRD header has no field \"endian\".");
  }
  return false;
}

std::int64_t skip_field(const NrrdFields& fields, std::string_view name) {
  const std::string_view text = value_of(fields, name);
  if (text.empty()) return 0;
  const auto count = parse_int64(text);
  if (!count || *count < -1) {
    throw_unusable("The NRRD header's " + in_quotes(name) + " is " + in_quotes(text) +
                   ", not a whole number of -1 or more.");
  }
  return *count;
}

std::uint64_t line_skip(const NrrdFields& fields) {
  const std::int64_t lines = skip_field(fields, "lineskip");
  if (lines < 0) throw_unusable("The NRRD header's \"lineskip\" is negative.");
  return static_cast<std::uint64_t>(lines);
}

bool is_stream(const SourceVolume& volume) {
  return volume.encoding == Encoding::kDeflate || volume.encoding == Encoding::kBzip2;
}

// The number of bytes to skip; empty if the samples are at the end of their file.
Skip byte_skip(const NrrdFields& fields, const SourceVolume& volume) {
  const std::int64_t bytes = skip_field(fields, "byteskip");
  const bool can_end = is_stream(volume) || volume.encoding == Encoding::kRaw;
  if (bytes < 0 && !can_end) {
    throw_unusable(
        "The NRRD header has a \"byteskip\" of -1, which is not possible for samples in text.");
  }
  return bytes < 0 ? Skip() : Skip(static_cast<std::uint64_t>(bytes));
}

std::uint64_t payload_offset(const InputFile& file, const NrrdHeader& header,
                             SourceVolume& volume) {
  const std::uint64_t lines = line_skip(header.fields);
  const Skip skip = byte_skip(header.fields, volume);
  if (!skip && volume.encoding == Encoding::kRaw) {
    if (file.size() < header.bytes + volume.stored_bytes()) {
      throw_unusable("The file is truncated: it is too short for its samples.");
    }
    return file.size() - volume.stored_bytes();
  }
  const std::uint64_t begin = skip_lines(file, header.bytes, lines);
  if (is_stream(volume)) volume.decoded_skip = skip;
  const std::uint64_t offset = is_stream(volume) ? begin : begin + *skip;
  if (offset > file.size()) throw_unusable("The file ends before its samples begin.");
  return offset;
}

// The names of the data files. After "LIST" they follow the header, one per line.
std::vector<std::string> data_names(const InputFile& file, const NrrdHeader& header) {
  const std::string_view said = value_of(header.fields, kDataFile);
  if (!names_list(header.fields)) {
    if (is_file_pattern(said)) return expand_file_pattern(said);
    return {std::string(said)};
  }
  LineReader lines(file, {.header = "The NRRD header's list of files"}, header.bytes);
  return rest_of(lines);
}

// A NIfTI file used as data begins with its own header, which some headers ignore.
bool has_own_header(const std::string& name, const Companions& companions) {
  const std::string head = InputFile(companion(name, companions)).text(0, kSniffBytes);
  return kNiftiReader.sniff(is_gzip(head) ? inflate_head(head, kSniffBytes) : head);
}

std::vector<DataFile> data_files(const InputFile& file, const NrrdHeader& header,
                                 const Companions& companions, SourceVolume& volume) {
  const std::uint64_t lines = line_skip(header.fields);
  const std::vector<std::string> names = data_names(file, header);
  Skip skip = byte_skip(header.fields, volume);
  if (skip == Skip(0) && lines == 0 && names.size() == 1 &&
      has_own_header(names.front(), companions)) {
    skip.reset();
    volume.notes.push_back(note_of(NoteCode::kTrailingBytes,
                                   "The data file has a header of its own, which was ignored. The "
                                   "samples were read from the end of the file."));
  }
  return data_files_of(names, companions, {.lines = lines, .bytes = skip}, volume);
}

// --- The volume ----------------------------------------------------------------------------------

// Tracked ultrasound has pairs for each image.
bool has_frames(const NrrdFields& fields) {
  const auto first = fields.lower_bound("Seq_Frame");
  return first != fields.end() && first->first.starts_with("Seq_Frame");
}

std::string frames_axis(const std::string& kind) {
  if (kind == "time") return "its axis of time";
  return kind == "list" ? "its axis of a list" : "its " + kind + ", beyond the three of space";
}

// The images of a sequence take turns with each sample or row, or follow each other.
StorageOrder axes_of_frames(std::uint64_t run, std::uint32_t row) {
  if (run == 1) return {2, 0, 1};
  if (run == row) return {0, 2, 1};
  return kXFastest;
}

// Sets dims, type and encoding, and selects one of several volumes.
SourceVolume samples_of(const NrrdFields& fields, const NrrdSizes& sizes,
                        const ImportOptions& options) {
  SourceVolume volume;
  volume.dims =
      volume_dims(std::span(sizes.lattice).first(std::min<std::size_t>(sizes.lattice.size(), 3)));
  volume.encoding = payload_encoding(fields);
  volume.layout.type = nrrd_type(fields);
  volume.layout.big_endian = is_big_endian(fields, volume.layout.type, volume.encoding);
  // Layers are consecutive or take turns with each sample.
  const bool is_interleaved = sizes.run == 1;
  const bool is_consecutive = sizes.run >= volume.sample_count();
  volume.is_segmentation = has_cropped_segments(fields) && sizes.lattice.size() >= 3;
  const bool is_layered = (is_interleaved || is_consecutive) && sizes.volumes > 1 &&
                          !options.volume && has_segments(fields) &&
                          is_integer(canonical_type(volume.layout));
  if (is_layered) {
    volume.chosen.count = sizes.volumes;
    set_segments(fields, is_interleaved, false, volume);
    return volume;
  }
  const std::string& kind = sizes.volume_kind;
  if (sizes.volumes == 1 && has_frames(fields)) {
    accept_frames(volume.dims[2], "its third axis, with a time or place for each (Seq_Frame)",
                  options, volume);
  }
  std::uint64_t count = sizes.volumes;
  if (kind == "vector") {
    refuse_flat("The file", volume.dims);
  } else {
    count = volumes_of_frames(count, frames_axis(kind), options, volume);
  }
  if (count < sizes.volumes) volume.storage_order = axes_of_frames(sizes.run, volume.dims[0]);
  choose_volume(count, numbered(kind == "time" ? kind : "their " + kind, kind), options, volume);
  if (count > 1 && !is_consecutive) volume.chosen.run = sizes.run;
  set_segments(fields, is_interleaved, true, volume);
  return volume;
}

bool is_nrrd(std::string_view head) {
  return head.size() >= 9 && head.starts_with("NRRD000") && head[7] >= '1' && head[7] <= '5' &&
         (head[8] == '\n' || head[8] == '\r');
}

std::vector<std::string> nrrd_data_names(const InputFile& file, const Companions& /*companions*/) {
  const NrrdHeader header = read_nrrd_header(file);
  return header.fields.contains(kDataFile) ? data_names(file, header) : std::vector<std::string>();
}

SourceVolume parse_nrrd(const InputFile& file, const Companions& companions,
                        const ImportOptions& options) {
  const NrrdHeader header = read_nrrd_header(file);
  const NrrdFields& fields = header.fields;
  const NrrdSizes sizes = nrrd_sizes(fields, axis_sizes(fields));
  SourceVolume volume = samples_of(fields, sizes, options);
  if (fields.contains(kDataFile)) {
    volume.data_files = data_files(file, header, companions, volume);
  } else {
    volume.payload = range_from(file, payload_offset(file, header, volume));
  }
  volume.geometry = nrrd_geometry(fields, sizes.all, options, volume.notes);
  scale_to_millimetres(nrrd_unit(fields, sizes.all), volume);
  volume.assumes_spacing = !nrrd_has_spacing(fields, sizes.all);
  return volume;
}

MostBytes most_nrrd_bytes(const InputFile& beginning, const ImportTask& task) {
  constexpr std::int64_t kMostSkipped = std::int64_t{64} << 20;
  const NrrdHeader header = read_nrrd_header(beginning);
  const NrrdFields& fields = header.fields;
  const SourceVolume volume =
      samples_of(fields, nrrd_sizes(fields, axis_sizes(fields)), task.options);
  check_limits(volume, task.limits);
  const std::int64_t skipped =
      std::clamp<std::int64_t>(skip_field(fields, "byteskip"), 0, kMostSkipped);
  const std::uint64_t samples =
      static_cast<std::uint64_t>(skipped) + volume.most_encoded_bytes() + kHeadroomBytes;
  const std::uint64_t list = kMostTextHeaderBytes + kHeadroomBytes;  // of names
  const std::uint64_t lines = line_skip(fields) > 0 ? kMostSkipped : 0;
  if (fields.contains(kDataFile)) return {.file = list, .data = lines + samples};
  return {.file = header.bytes + samples};
}

}  // namespace

constinit const Reader kNrrdReader = {.name = "nrrd",
                                      .sniff = is_nrrd,
                                      .describe = parse_nrrd,
                                      .most_bytes = most_nrrd_bytes,
                                      .data_names = nrrd_data_names};

}  // namespace isomesh::import
