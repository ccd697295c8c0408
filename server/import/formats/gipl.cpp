#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "server/import/formats/format_readers.h"
#include "server/import/formats/placing.h"
#include "server/import/source/header_fields.h"

namespace isomesh::import {
namespace {

constexpr std::size_t kGiplHeaderBytes = 256;  // all of it big-endian
constexpr std::size_t kMagicPlace = 252;
constexpr std::uint32_t kMagic = 0xefffe9b0;
constexpr std::uint32_t kOtherMagic = 0x2ae389b8;

std::optional<StoredType> gipl_type(std::uint16_t code) {
  switch (code) {
    case 7:
      return StoredType::kInt8;
    case 8:
      return StoredType::kUint8;
    case 15:
      return StoredType::kInt16;
    case 16:
      return StoredType::kUint16;
    case 31:
      return StoredType::kUint32;
    case 32:
      return StoredType::kInt32;
    case 64:
      return StoredType::kFloat32;
    case 65:
      return StoredType::kFloat64;
    default:
      return std::nullopt;
  }
}

bool is_gipl(std::string_view head) {
  if (head.size() < kGiplHeaderBytes) return false;
  const auto magic = HeaderBytes(head, true).at<std::uint32_t>(kMagicPlace);
  return magic == kMagic || magic == kOtherMagic;
}

SourceVolume parse_gipl(const InputFile& file, const Companions& /*companions*/,
                        const ImportOptions& options) {
  const std::string text = file.text(0, kGiplHeaderBytes);
  if (!is_gipl(text)) throw_unusable("The GIPL header is damaged.");
  const HeaderBytes header(text, true);
  std::array<std::uint64_t, 4> sizes = {};
  header.read<std::uint16_t>(0, sizes);
  // Headers of three axes may have a zero there.
  sizes[3] = std::max<std::uint64_t>(sizes[3], 1);
  const auto code = header.at<std::uint16_t>(8);
  const auto type = gipl_type(code);
  if (!type) {
    throw_unusable("The GIPL file's samples are of type " + std::to_string(code) +
                   ", which is not supported. Integers of 8 to 32 bits and floats are (7, 8, 15, "
                   "16, 31, 32, 64, 65).");
  }
  SourceVolume volume;
  volume.dims = volume_dims(std::span(sizes).first(3));
  volume.layout = {*type, true, std::nullopt};
  choose_volume(volumes_beyond(sizes), numbered("their fourth axis", "frame"), options, volume);
  volume.payload.offset = kGiplHeaderBytes;
  header.read<float>(10, volume.geometry.spacing);
  header.read<double>(204, volume.geometry.origin);
  volume.notes.push_back(lps_assumed("A GIPL file"));
  return volume;
}

}  // namespace

constinit const Reader kGiplReader = {.name = "gipl", .sniff = is_gipl, .describe = parse_gipl};

}  // namespace isomesh::import
