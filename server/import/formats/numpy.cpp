#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/text.h"
#include "proto/error.h"
#include "server/import/formats/format_readers.h"
#include "server/import/source/header_fields.h"

namespace isomesh::import {
namespace {

constexpr std::string_view kNpyMagic = "\x93NUMPY";
constexpr std::size_t kMostDictionaryBytes = std::size_t{1} << 16;

struct NpyHeader {
  std::string type;  // as in NumPy: "<f4"
  bool is_fortran = false;
  std::vector<std::uint64_t> shape;
  std::uint64_t bytes = 0;
};

[[noreturn]] void throw_damaged_header() { throw_unusable("The NumPy header is damaged."); }

// The text behind a key of the header, a dictionary in Python's notation.
std::string_view dictionary_value(std::string_view text, std::string_view key) {
  for (const char quote : {'\'', '"'}) {
    const std::size_t at = text.find(quote + std::string(key) + quote);
    if (at == std::string_view::npos) continue;
    const std::size_t colon = text.find(':', at);
    if (colon != std::string_view::npos) return trimmed(text.substr(colon + 1));
  }
  throw_damaged_header();
}

std::vector<std::uint64_t> shape_of(std::string_view text) {
  const std::size_t end = text.find(')');
  if (!text.starts_with('(') || end == std::string_view::npos) throw_damaged_header();
  std::vector<std::uint64_t> shape;
  for (std::string_view word : split(text.substr(1, end - 1), ',')) {
    if (word.empty()) continue;
    if (word.ends_with('L')) word.remove_suffix(1);  // written by Python 2
    const auto size = parse_uint64(word);
    if (!size) throw_damaged_header();
    shape.push_back(*size);
  }
  return shape;
}

bool is_numpy(std::string_view head) {
  return head.size() >= 8 && head.starts_with(kNpyMagic) && head[6] >= 1 && head[6] <= 3;
}

NpyHeader read_npy_header(std::string_view head) {
  if (!is_numpy(head) || head.size() < 12) throw_damaged_header();
  const HeaderBytes numbers(head, false);
  const bool is_long = head[6] > 1;
  const std::size_t begin = is_long ? 12 : 10;
  const std::size_t size = is_long ? numbers.at<std::uint32_t>(8) : numbers.at<std::uint16_t>(8);
  if (size > kMostDictionaryBytes || head.size() < begin + size) throw_damaged_header();
  const std::string_view text = head.substr(begin, size);
  NpyHeader header;
  header.bytes = begin + size;
  const std::string_view type = dictionary_value(text, "descr");
  const std::size_t end = type.find_first_of("'\"", 1);
  if (type.starts_with('\'') || type.starts_with('"')) {
    header.type = type.substr(1, std::min(end, type.size()) - 1);
  }
  header.is_fortran = dictionary_value(text, "fortran_order").starts_with("True");
  header.shape = shape_of(dictionary_value(text, "shape"));
  return header;
}

struct TypeRow {
  std::string_view name;  // without the byte order
  StoredType type;
  Encoding encoding = Encoding::kRaw;
};

const TypeRow* type_row(const NpyHeader& header) {
  static constexpr TypeRow kTypes[] = {
      {"b1", StoredType::kUint8},   {"i1", StoredType::kInt8},
      {"u1", StoredType::kUint8},   {"i2", StoredType::kInt16},
      {"u2", StoredType::kUint16},  {"i4", StoredType::kInt32},
      {"u4", StoredType::kUint32},  {"i8", StoredType::kInt64},
      {"u8", StoredType::kUint64},  {"f4", StoredType::kFloat32},
      {"f8", StoredType::kFloat64}, {"f2", StoredType::kFloat32, Encoding::kHalf}};
  if (header.type.empty() || std::string_view("<>|=").find(header.type[0]) == std::string::npos) {
    return nullptr;
  }
  const auto* found =
      std::ranges::find(kTypes, std::string_view(header.type).substr(1), &TypeRow::name);
  return found == std::end(kTypes) ? nullptr : found;
}

// A first of four axes holds the volumes.
bool has_volumes(const NpyHeader& header) { return header.shape.size() == 4; }

bool is_shape_of_volume(const NpyHeader& header) {
  return header.shape.size() == 3 || has_volumes(header);
}

std::string text_of(const std::vector<std::uint64_t>& shape) {
  std::string text;
  for (const std::uint64_t size : shape) text += (text.empty() ? "" : ", ") + std::to_string(size);
  return "(" + text + ")";
}

bool may_hold_numpy_volume(std::string_view head) {
  try {
    const NpyHeader header = read_npy_header(head);
    return is_shape_of_volume(header) && type_row(header) != nullptr;
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kUnusableVolume) throw;
    return true;  // reading it reports the damage
  }
}

SourceVolume parse_numpy(const InputFile& file, const Companions& /*companions*/,
                         const ImportOptions& options) {
  const NpyHeader header = read_npy_header(file.text(0, kMostDictionaryBytes + 12));
  const TypeRow* row = type_row(header);
  if (row == nullptr) {
    throw_unusable("The NumPy array's type " + in_quotes(header.type) +
                   " is not supported. A sample must be one real number.");
  }
  if (header.shape.size() == 2) {
    refuse_flat("The NumPy array",
                volume_dims(std::vector{header.shape[1], header.shape[0], std::uint64_t{1}}));
  }
  if (!is_shape_of_volume(header)) {
    throw_unusable("The NumPy array has the shape " + text_of(header.shape) +
                   ". A volume has three axes, or four of which the first holds several volumes.");
  }
  const std::vector<std::uint64_t> xyz(header.shape.rbegin(), header.shape.rbegin() + 3);
  SourceVolume volume;
  volume.dims = volume_dims(xyz);
  volume.layout = {row->type, header.type[0] == '>', std::nullopt};
  volume.encoding = row->encoding;
  std::vector<std::uint64_t> sizes = xyz;
  if (has_volumes(header)) sizes.push_back(header.shape.front());
  choose_volume(volumes_beyond(sizes), numbered("the array's first index", "index"), options,
                volume);
  if (header.is_fortran) {
    volume.storage_order = {2, 1, 0};
    if (volume.chosen.count > 1) volume.chosen.run = 1;
  }
  volume.payload = range_from(file, header.bytes);
  volume.has_spacing = false;
  volume.notes.push_back(
      note_of(NoteCode::kSpaceAssumed,
              "A NumPy array has no patient. Its last three axes were read as z, y and x in LPS."));
  return volume;
}

}  // namespace

constinit const Reader kNumpyReader = {.name = "numpy",
                                       .sniff = is_numpy,
                                       .may_hold_volume = may_hold_numpy_volume,
                                       .describe = parse_numpy};

}  // namespace isomesh::import
