#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/import/formats/format_readers.h"
#include "server/import/formats/placing.h"
#include "server/import/source/header_fields.h"

namespace isomesh::import {
namespace {

constexpr std::size_t kMghHeaderBytes = 284;  // all of it big-endian
constexpr std::int32_t kVersion = 1;

std::optional<StoredType> type_of(std::int32_t code) {
  switch (code) {
    case 0:
      return StoredType::kUint8;
    case 1:
      return StoredType::kInt32;
    case 3:
      return StoredType::kFloat32;
    case 4:
      return StoredType::kInt16;
    case 10:
      return StoredType::kUint16;
    default:
      return std::nullopt;
  }
}

// Width, height, depth and frames.
std::array<std::int64_t, 4> sizes_of(const HeaderBytes& header) {
  std::array<std::int64_t, 4> sizes = {};
  header.read<std::int32_t>(4, sizes);
  return sizes;
}

// The cosines of the columns in RAS, and the centre of the volume.
struct Axes {
  std::array<Vector3, 3> cosines = {Vector3{-1, 0, 0}, Vector3{0, 0, -1}, Vector3{0, 1, 0}};
  Vector3 centre = {0, 0, 0};
};

Geometry geometry_of_header(const HeaderBytes& header, SourceVolume& volume) {
  Vector3 spacing = {1, 1, 1};
  Axes axes;
  if (header.at<std::int16_t>(28) == 1) {
    header.read<float>(30, spacing);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      header.read<float>(42 + axis * 12, axes.cosines[axis]);
    }
    header.read<float>(78, axes.centre);
  } else {
    volume.notes.push_back(
        note_of(NoteCode::kSpaceAssumed,
                "The MGH header does not say how its axes lie in the patient. Coronal slices with "
                "steps of 1 mm were assumed, as FreeSurfer does."));
  }
  Vector3 origin = axes.centre;
  std::array<Vector3, 3> steps = axes.cosines;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t row = 0; row < 3; ++row) {
      steps[axis][row] *= spacing[axis];
      origin[row] -= steps[axis][row] * volume.dims[axis] / 2.0;
    }
  }
  return geometry_of_ras(origin, steps);
}

bool is_mgh(std::string_view head) {
  if (head.size() < kMghHeaderBytes) return false;
  const HeaderBytes header(head, true);
  const auto is_size = [](std::int64_t size) { return size > 0; };
  const auto good = header.at<std::int16_t>(28);
  return header.at<std::int32_t>(0) == kVersion && type_of(header.at<std::int32_t>(20)) &&
         std::ranges::all_of(sizes_of(header), is_size) && (good == 0 || good == 1);
}

SourceVolume parse_mgh(const InputFile& file, const Companions& /*companions*/,
                       const ImportOptions& options) {
  const std::string text = file.text(0, kMghHeaderBytes);
  if (!is_mgh(text)) throw_unusable("The MGH header is damaged.");
  const HeaderBytes header(text, true);
  std::array<std::uint64_t, 4> sizes = {};
  std::ranges::transform(sizes_of(header), sizes.begin(),
                         [](std::int64_t size) { return static_cast<std::uint64_t>(size); });
  SourceVolume volume;
  volume.dims = volume_dims(std::span(sizes).first(3));
  check_is_lattice(volume.dims);
  volume.layout = {type_of(header.at<std::int32_t>(20)).value(), true, std::nullopt};
  choose_volume(volumes_beyond(sizes), numbered("their frame", "frame"), options, volume);
  volume.payload.offset = kMghHeaderBytes;
  volume.has_footer = true;
  volume.geometry = geometry_of_header(header, volume);
  return volume;
}

}  // namespace

constinit const Reader kMghReader = {.name = "mgh", .sniff = is_mgh, .describe = parse_mgh};

}  // namespace isomesh::import
