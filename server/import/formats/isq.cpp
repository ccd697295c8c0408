#include <algorithm>
#include <array>
#include <cstdint>
#include <string>

#include "server/import/formats/format_readers.h"
#include "server/import/formats/placing.h"
#include "server/import/source/header_fields.h"

namespace isomesh::import {
namespace {

constexpr std::string_view kIsqMagic = "CTDATA-HEADER_V1";
constexpr std::size_t kIsqBlockBytes = 512;  // the header is the first block
constexpr std::int32_t kShorts = 3;

// Sizes in samples, and the same in micrometres.
void set_lattice(const HeaderBytes& header, SourceVolume& volume) {
  std::array<std::int64_t, 3> samples = {};
  std::array<std::int64_t, 3> micrometres = {};
  header.read<std::int32_t>(44, samples);
  header.read<std::int32_t>(56, micrometres);
  std::array<std::uint64_t, 3> sizes = {};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (samples[axis] < 1 || micrometres[axis] < 1) {
      throw_unusable("The ISQ header's sizes are not positive.");
    }
    sizes[axis] = static_cast<std::uint64_t>(samples[axis]);
    volume.geometry.spacing[axis] =
        static_cast<double>(micrometres[axis]) / static_cast<double>(samples[axis]) / 1000;
  }
  volume.dims = volume_dims(sizes);
  volume.geometry.origin[2] = header.at<std::int32_t>(76) / 1000.0;
}

bool is_isq(std::string_view head) {
  return head.size() >= kIsqBlockBytes && head.starts_with(kIsqMagic);
}

SourceVolume parse_isq(const InputFile& file, const Companions& /*companions*/,
                       const ImportOptions& options) {
  const std::string head = file.text(0, kIsqBlockBytes);
  if (!is_isq(head)) throw_unusable("The ISQ header is damaged.");
  const HeaderBytes header(head, false);
  const auto type = header.at<std::int32_t>(16);
  if (type != kShorts) {
    throw_unusable("The ISQ file's data type " + std::to_string(type) +
                   " is not supported. 3 (16-bit integers) is.");
  }
  const auto blocks = header.at<std::int32_t>(508);
  if (blocks < 0) throw_unusable("The ISQ header's position of the samples is negative.");
  SourceVolume volume;
  volume.layout.type = StoredType::kInt16;
  set_lattice(header, volume);
  choose_volume(1, {}, options, volume);
  const std::uint64_t offset = (static_cast<std::uint64_t>(blocks) + 1) * kIsqBlockBytes;
  volume.payload = range_from(file, offset);
  volume.notes.push_back(lps_assumed("An ISQ file"));
  return volume;
}

}  // namespace

constinit const Reader kIsqReader = {.name = "isq", .sniff = is_isq, .describe = parse_isq};

}  // namespace isomesh::import
