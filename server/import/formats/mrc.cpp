#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "server/import/formats/format_readers.h"
#include "server/import/formats/placing.h"
#include "server/import/source/header_fields.h"

namespace isomesh::import {
namespace {

constexpr std::size_t kMrcHeaderBytes = 1024;
constexpr int kStackOfVolumes = 401;

struct MrcHeader {
  bool big_endian = false;
  std::array<std::int64_t, 3> size = {};      // of columns, rows and sections
  std::array<std::int64_t, 3> start = {};     // of columns, rows and sections
  std::array<std::int64_t, 3> sampling = {};  // of the cell, along x, y and z
  std::array<double, 3> cell = {};            // lengths along x, y and z
  std::array<double, 3> angles = {};
  std::array<std::int64_t, 3> axes = {};  // 1 to 3: x, y or z of columns, rows and sections
  std::array<double, 3> origin = {};
  int mode = 0;
  int space_group = 0;
  std::int64_t extended_bytes = 0;
  bool is_unsigned = false;  // mode 0 of older IMOD
};

bool is_permutation(std::array<std::int64_t, 3> axes) {
  std::ranges::sort(axes);
  return axes == std::array<std::int64_t, 3>{1, 2, 3};
}

MrcHeader read_as(std::string_view head, bool big_endian) {
  constexpr std::int32_t kImod = 1146047817;
  const HeaderBytes bytes(head, big_endian);
  MrcHeader header;
  header.big_endian = big_endian;
  bytes.read<std::int32_t>(0, header.size);
  header.mode = bytes.at<std::int32_t>(12);
  bytes.read<std::int32_t>(16, header.start);
  bytes.read<std::int32_t>(28, header.sampling);
  bytes.read<float>(40, header.cell);
  bytes.read<float>(52, header.angles);
  bytes.read<std::int32_t>(64, header.axes);
  header.space_group = bytes.at<std::int32_t>(88);
  header.extended_bytes = bytes.at<std::int32_t>(92);
  header.is_unsigned = bytes.at<std::int32_t>(152) == kImod && bytes.at<std::int32_t>(156) % 2 == 0;
  bytes.read<float>(196, header.origin);
  return header;
}

// Empty if the header makes sense in neither byte order. Axes of 0, which some programs write, are
// those of x, y and z.
std::optional<MrcHeader> find_header(std::string_view head) {
  if (head.size() < kMrcHeaderBytes || head.substr(208, 3) != "MAP") return std::nullopt;
  for (const bool big_endian : {false, true}) {
    MrcHeader header = read_as(head, big_endian);
    if (header.axes == std::array<std::int64_t, 3>{}) header.axes = {1, 2, 3};
    const bool is_sized = std::ranges::all_of(header.size, [](auto size) { return size > 0; });
    if (is_sized && is_permutation(header.axes) && header.mode >= 0 && header.mode < 128) {
      return header;
    }
  }
  return std::nullopt;
}

void set_type(const MrcHeader& header, SourceVolume& volume) {
  const auto set = [&](StoredType type) { volume.layout = {type, header.big_endian, {}}; };
  switch (header.mode) {
    case 0:
      return set(header.is_unsigned ? StoredType::kUint8 : StoredType::kInt8);
    case 1:
      return set(StoredType::kInt16);
    case 2:
      return set(StoredType::kFloat32);
    case 6:
      return set(StoredType::kUint16);
    case 12:
      volume.encoding = Encoding::kHalf;
      return set(StoredType::kFloat32);
    case 3:
    case 4:
      throw_unusable("The samples of the MRC file are complex numbers (mode " +
                     std::to_string(header.mode) + "). A sample must be one real number.");
    default:
      throw_unusable("The MRC file's mode " + std::to_string(header.mode) +
                     " is not supported. 0, 1, 2, 6 and 12 are.");
  }
}

// The unit vectors of the cell: a along x, b in the plane of x and y. Angles of 0 are right angles.
std::array<Vector3, 3> cell_axes(const MrcHeader& header) {
  const bool is_right =
      std::ranges::all_of(header.angles, [](double angle) { return angle == 0 || angle == 90; });
  if (is_right) return {Vector3{1, 0, 0}, Vector3{0, 1, 0}, Vector3{0, 0, 1}};
  std::array<double, 3> cosine = {};
  std::ranges::transform(header.angles, cosine.begin(),
                         [](double angle) { return std::cos(angle * std::numbers::pi / 180); });
  const double sine = std::sin(header.angles[2] * std::numbers::pi / 180);
  const double y = (cosine[0] - cosine[1] * cosine[2]) / sine;
  const double rest = 1 - cosine[1] * cosine[1] - y * y;
  if (!(rest > 0) || !std::isfinite(y)) {
    throw_unusable("The angles of the MRC file's cell are not those of a cell.");
  }
  return {Vector3{1, 0, 0}, Vector3{cosine[2], sine, 0}, Vector3{cosine[1], y, std::sqrt(rest)}};
}

// Along x, y and z.
std::array<double, 3> first_index(const MrcHeader& header) {
  std::array<double, 3> first = {};
  for (std::size_t at = 0; at < 3; ++at) {
    first[static_cast<std::size_t>(header.axes[at]) - 1] = static_cast<double>(header.start[at]);
  }
  return first;
}

void place(const MrcHeader& header, SourceVolume& volume) {
  std::array<Vector3, 3> steps = cell_axes(header);
  Vector3 origin = header.origin;
  const bool has_origin = std::ranges::any_of(origin, [](double part) { return part != 0; });
  const std::array<double, 3> first = first_index(header);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double step = header.cell[axis] / static_cast<double>(header.sampling[axis]);
    if (!std::isfinite(step) || !(step > 0)) {
      volume.has_spacing = false;
      return;
    }
    for (std::size_t row = 0; row < 3; ++row) {
      steps[axis][row] *= step;
      if (!has_origin) origin[row] += steps[axis][row] * first[axis];
    }
  }
  volume.geometry = geometry_of(origin, steps);
}

// The number of volumes in a stack, whose sections are one behind the other.
std::uint64_t volumes_of(const MrcHeader& header) {
  const std::int64_t sections = header.size[2];
  const std::int64_t each = header.sampling[2];
  if (header.space_group == 0 && each == 1 && sections > 1) {
    throw_unusable("The MRC file holds a stack of " + std::to_string(sections) +
                   " images (space group 0), not a volume.");
  }
  if (header.space_group != kStackOfVolumes) return 1;
  if (each < 1 || sections % each != 0) {
    throw_unusable("The MRC file's " + std::to_string(sections) +
                   " sections cannot be divided into volumes of " + std::to_string(each) + ".");
  }
  return static_cast<std::uint64_t>(sections / each);
}

bool is_mrc(std::string_view head) { return find_header(head).has_value(); }

SourceVolume parse_mrc(const InputFile& file, const Companions& /*companions*/,
                       const ImportOptions& options) {
  const auto header = find_header(file.text(0, kMrcHeaderBytes));
  if (!header) throw_unusable("The MRC header is damaged.");
  if (header->extended_bytes < 0) throw_unusable("The MRC header's extended size is negative.");
  const std::uint64_t volumes = volumes_of(*header);
  SourceVolume volume;
  std::array<std::uint64_t, 3> sizes = {};
  for (std::size_t at = 0; at < 3; ++at) {
    volume.storage_order[at] = static_cast<std::size_t>(header->axes[at]) - 1;
    const auto size = static_cast<std::uint64_t>(header->size[at]);
    sizes[volume.storage_order[at]] = at == 2 ? size / volumes : size;
  }
  volume.dims = volume_dims(sizes);
  set_type(*header, volume);
  choose_volume(volumes, numbered("their place in the stack", "volume"), options, volume);
  const std::uint64_t offset = kMrcHeaderBytes + static_cast<std::uint64_t>(header->extended_bytes);
  volume.payload = range_from(file, offset);
  place(*header, volume);
  volume.notes.push_back(angstrom_note("the MRC file"));
  return volume;
}

}  // namespace

constinit const Reader kMrcReader = {.name = "mrc", .sniff = is_mrc, .describe = parse_mrc};

}  // namespace isomesh::import
