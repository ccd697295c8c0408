#include "server/import/formats/nifti.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <optional>
#include <vector>

#include "base/text.h"
#include "server/import/archives/gzip.h"

namespace isomesh::import {
namespace {

constexpr std::size_t kNifti1Bytes = 348;
constexpr std::size_t kNifti2Bytes = 540;

// The fields of either version that a volume needs, in this machine's byte order.
struct Header {
  bool big_endian = false;
  bool detached = false;
  std::array<std::int64_t, 8> dim = {};
  std::array<double, 8> pixdim = {};
  int datatype = 0;
  int bits = 0;
  double vox_offset = 0;
  double slope = 0;
  double intercept = 0;
  int units = 0;
  int qform_code = 0;
  int sform_code = 0;
  std::array<double, 3> quaternion = {};
  Vector3 qoffset = {};
  std::array<double, 12> srow = {};  // row-major, 3 x 4
};

class Fields {
 public:
  Fields(std::string_view bytes, bool big_endian) : bytes_(bytes), big_endian_(big_endian) {}

  template <class Stored>
  Stored at(std::size_t offset) const {
    std::array<std::byte, sizeof(Stored)> raw;
    std::memcpy(raw.data(), bytes_.data() + offset, sizeof(Stored));
    if (big_endian_) std::reverse(raw.begin(), raw.end());
    Stored value;
    std::memcpy(&value, raw.data(), sizeof(Stored));
    return value;
  }

  template <class Stored, class Value, std::size_t Count>
  void read(std::size_t offset, std::array<Value, Count>& values) const {
    for (Value& value : values) {
      value = at<Stored>(offset);
      offset += sizeof(Stored);
    }
  }

 private:
  std::string_view bytes_;
  bool big_endian_;
};

enum class Version { kOne, kTwo };

struct Kind {
  Version version = Version::kOne;
  bool big_endian = false;
  bool detached = false;
};

std::optional<Kind> kind_of(std::string_view head) {
  using std::string_view_literals::operator""sv;
  if (head.size() < kNifti1Bytes) return std::nullopt;
  for (const bool big_endian : {false, true}) {
    const auto size = Fields(head, big_endian).at<std::int32_t>(0);
    if (size == kNifti1Bytes) {
      const std::string_view magic = head.substr(344, 4);
      if (magic == "n+1\0"sv || magic == "ni1\0"sv) {
        return Kind{Version::kOne, big_endian, magic == "ni1\0"sv};
      }
    }
    if (size == kNifti2Bytes) {
      const std::string_view magic = head.substr(4, 4);
      if (magic == "n+2\0"sv || magic == "ni2\0"sv) {
        return Kind{Version::kTwo, big_endian, magic == "ni2\0"sv};
      }
    }
  }
  return std::nullopt;
}

Header read_nifti1(const Fields& fields) {
  Header header;
  fields.read<std::int16_t>(40, header.dim);
  header.datatype = fields.at<std::int16_t>(70);
  header.bits = fields.at<std::int16_t>(72);
  fields.read<float>(76, header.pixdim);
  header.vox_offset = fields.at<float>(108);
  header.slope = fields.at<float>(112);
  header.intercept = fields.at<float>(116);
  header.units = fields.at<std::uint8_t>(123);
  header.qform_code = fields.at<std::int16_t>(252);
  header.sform_code = fields.at<std::int16_t>(254);
  fields.read<float>(256, header.quaternion);
  fields.read<float>(268, header.qoffset);
  fields.read<float>(280, header.srow);
  return header;
}

Header read_nifti2(const Fields& fields) {
  Header header;
  header.datatype = fields.at<std::int16_t>(12);
  header.bits = fields.at<std::int16_t>(14);
  fields.read<std::int64_t>(16, header.dim);
  fields.read<double>(104, header.pixdim);
  header.vox_offset = static_cast<double>(fields.at<std::int64_t>(168));
  header.slope = fields.at<double>(176);
  header.intercept = fields.at<double>(184);
  header.qform_code = fields.at<std::int32_t>(344);
  header.sform_code = fields.at<std::int32_t>(348);
  fields.read<double>(352, header.quaternion);
  fields.read<double>(376, header.qoffset);
  fields.read<double>(400, header.srow);
  header.units = fields.at<std::int32_t>(500);
  return header;
}

Header read_header(std::string_view head) {
  const auto kind = kind_of(head);
  if (!kind) throw_unusable("The NIfTI header is damaged.");
  if (kind->version == Version::kTwo && head.size() < kNifti2Bytes) {
    throw_unusable("The file ends within its NIfTI-2 header.");
  }
  const Fields fields(head, kind->big_endian);
  Header header = kind->version == Version::kOne ? read_nifti1(fields) : read_nifti2(fields);
  header.big_endian = kind->big_endian;
  header.detached = kind->detached;
  return header;
}

std::array<std::uint32_t, 3> dims_of(const Header& header) {
  if (header.dim[0] < 1 || header.dim[0] > 7) {
    throw_unusable("The NIfTI header tells " + std::to_string(header.dim[0]) +
                   " dimensions, where 1 to 7 are possible.");
  }
  std::vector<std::uint64_t> sizes;
  for (std::size_t axis = 1; axis <= static_cast<std::size_t>(header.dim[0]); ++axis) {
    if (header.dim[axis] < 0) {
      throw_unusable("The size along " + axis_name(axis - 1) + " is " +
                     std::to_string(header.dim[axis]) + ".");
    }
    sizes.push_back(static_cast<std::uint64_t>(header.dim[axis]));
  }
  return volume_dims(sizes);
}

StoredType type_of(const Header& header) {
  struct Row {
    int code;
    StoredType type;
  };
  static constexpr Row kReadable[] = {
      {2, StoredType::kUint8},     {4, StoredType::kInt16},    {8, StoredType::kInt32},
      {16, StoredType::kFloat32},  {64, StoredType::kFloat64}, {256, StoredType::kInt8},
      {512, StoredType::kUint16},  {768, StoredType::kUint32}, {1024, StoredType::kInt64},
      {1280, StoredType::kUint64},
  };
  struct Name {
    int code;
    const char* name;
  };
  static constexpr Name kOthers[] = {
      {1, "single bits"},
      {32, "complex numbers (complex64)"},
      {128, "colours (RGB24)"},
      {1536, "128-bit floats (float128)"},
      {1792, "complex numbers (complex128)"},
      {2048, "complex numbers (complex256)"},
      {2304, "colours (RGBA32)"},
  };
  for (const Row& row : kReadable) {
    if (row.code != header.datatype) continue;
    const int bits = static_cast<int>(bytes_per_sample(row.type) * 8);
    if (header.bits != 0 && header.bits != bits) {
      throw_unusable("The NIfTI header contradicts itself: its datatype " +
                     std::to_string(header.datatype) + " has " + std::to_string(bits) +
                     " bits, its bitpix is " + std::to_string(header.bits) + ".");
    }
    return row.type;
  }
  for (const Name& other : kOthers) {
    if (other.code != header.datatype) continue;
    throw_unusable(std::string("The samples are ") + other.name +
                   ", where plain numbers are needed.");
  }
  throw_unusable("The NIfTI header's datatype " + std::to_string(header.datatype) + " is unknown.");
}

// The standard writes a slope of 0 where there is none; several programs write NaN.
std::optional<Rescale> rescale_of(const Header& header) {
  if (header.slope == 0 || std::isnan(header.slope)) return std::nullopt;
  if (!std::isfinite(header.slope) || !std::isfinite(header.intercept)) {
    throw_unusable("The slope " + to_text(header.slope) + " and intercept " +
                   to_text(header.intercept) + " of the samples are not finite numbers.");
  }
  if (header.slope == 1 && header.intercept == 0) return std::nullopt;
  return Rescale{header.slope, header.intercept};
}

double millimetres_per_unit(const Header& header) {
  constexpr int kSpatialUnits = 7;
  switch (header.units & kSpatialUnits) {
    case 0:
    case 2:
      return 1;
    case 1:
      return 1000;
    case 3:
      return 0.001;
    default:
      throw_unusable("The NIfTI header's spatial unit " +
                     std::to_string(header.units & kSpatialUnits) + " is unknown.");
  }
}

// Along an axis of a single sample there is no distance, and some programs write 0.
Vector3 spacing_of(const Header& header, const std::array<std::uint32_t, 3>& dims) {
  Vector3 spacing;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    spacing[axis] = header.pixdim[axis + 1];
    if (dims[axis] == 1 && !(spacing[axis] > 0)) spacing[axis] = 1;
    if (std::isfinite(spacing[axis]) && spacing[axis] > 0) continue;
    throw_unusable("The voxel size along " + axis_name(axis) + " is " + to_text(spacing[axis]) +
                   ", not a positive number.");
  }
  return spacing;
}

// Where the samples lie, in RAS and in the file's unit.
struct Placement {
  Vector3 origin = {};
  std::array<Vector3, 3> steps = {};
};

Placement sform_of(const Header& header) {
  Placement placement;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      placement.steps[axis][row] = header.srow[row * 4 + axis];
    }
    placement.origin[row] = header.srow[row * 4 + 3];
  }
  return placement;
}

// The quaternion has length 1 and its real part is never negative, so that part is not stored.
Placement qform_of(const Header& header, const Vector3& spacing) {
  auto [b, c, d] = header.quaternion;
  const double squares = b * b + c * c + d * d;
  constexpr double kRounding = 1e-3;
  if (!(squares <= 1 + kRounding)) {
    throw_unusable("The quaternion of the NIfTI header's qform is no rotation.");
  }
  const double a = std::sqrt(std::max(0.0, 1 - squares));
  const double norm = std::sqrt(std::max(1.0, squares));
  b /= norm;
  c /= norm;
  d /= norm;
  const double last = header.pixdim[0] < 0 ? -spacing[2] : spacing[2];
  Placement placement;
  placement.origin = header.qoffset;
  placement.steps[0] = {(a * a + b * b - c * c - d * d) * spacing[0],
                        2 * (b * c + a * d) * spacing[0], 2 * (b * d - a * c) * spacing[0]};
  placement.steps[1] = {2 * (b * c - a * d) * spacing[1],
                        (a * a + c * c - b * b - d * d) * spacing[1],
                        2 * (c * d + a * b) * spacing[1]};
  placement.steps[2] = {2 * (b * d + a * c) * last, 2 * (c * d - a * b) * last,
                        (a * a + d * d - b * b - c * c) * last};
  return placement;
}

bool agree(const Placement& one, const Placement& other, const std::array<std::uint32_t, 3>& dims) {
  constexpr double kVoxels = 0.01;
  double smallest_step = HUGE_VAL;
  double apart = 0;
  for (std::size_t row = 0; row < 3; ++row) {
    // No corner differs by more than the sum of the differences of the origin and of all steps.
    double off = std::abs(one.origin[row] - other.origin[row]);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      off += std::abs(one.steps[axis][row] - other.steps[axis][row]) * (dims[axis] - 1.0);
    }
    apart = std::max(apart, off);
  }
  for (const Vector3& step : other.steps) {
    smallest_step = std::min(smallest_step, std::hypot(step[0], step[1], step[2]));
  }
  return apart <= smallest_step * kVoxels;
}

void check_sform(const Placement& sform, const Vector3& spacing,
                 const std::array<std::uint32_t, 3>& dims) {
  constexpr double kTolerance = 0.01;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Vector3& step = sform.steps[axis];
    const double size = std::hypot(step[0], step[1], step[2]);
    if (dims[axis] == 1 && std::isfinite(size) && size > 0) continue;
    if (std::abs(size - spacing[axis]) <= spacing[axis] * kTolerance) continue;
    throw_unusable("The NIfTI header contradicts itself: along " + axis_name(axis) +
                   " a voxel is " + to_text(spacing[axis]) + " long by its pixdim and " +
                   to_text(size) + " by its sform.");
  }
}

Placement without_forms(const Vector3& spacing) {
  Placement placement;
  // The axes of LPS, written in RAS.
  placement.steps[0][0] = -spacing[0];
  placement.steps[1][1] = -spacing[1];
  placement.steps[2][2] = spacing[2];
  return placement;
}

Placement placement_of(const Header& header, const std::array<std::uint32_t, 3>& dims) {
  constexpr int kScanner = 1;
  const Vector3 spacing = spacing_of(header, dims);
  if (header.sform_code <= 0 && header.qform_code <= 0) return without_forms(spacing);
  if (header.sform_code <= 0) return qform_of(header, spacing);
  const Placement sform = sform_of(header);
  if (header.qform_code > 0 && header.sform_code != kScanner) {
    const Placement qform = qform_of(header, spacing);
    if (!agree(sform, qform, dims)) return qform;
  }
  check_sform(sform, spacing, dims);
  return sform;
}

Vector3 to_lps(const Vector3& ras, double scale) {
  return {-ras[0] * scale, -ras[1] * scale, ras[2] * scale};
}

Geometry lps_geometry(const Header& header, const std::array<std::uint32_t, 3>& dims) {
  const Placement placement = placement_of(header, dims);
  const double scale = millimetres_per_unit(header);
  std::array<Vector3, 3> steps;
  std::transform(placement.steps.begin(), placement.steps.end(), steps.begin(),
                 [&](const Vector3& step) { return to_lps(step, scale); });
  return geometry_of(to_lps(placement.origin, scale), steps);
}

std::uint64_t payload_offset(const Header& header) {
  // Header extensions are small; a larger offset is damage.
  constexpr double kMost = 64 << 20;
  if (!(header.vox_offset >= kNifti1Bytes && header.vox_offset <= kMost) ||
      header.vox_offset != std::floor(header.vox_offset)) {
    throw_unusable("The NIfTI header's vox_offset is " + to_text(header.vox_offset) +
                   ", which no place in the file can be.");
  }
  return static_cast<std::uint64_t>(header.vox_offset);
}

SourceVolume describe(std::string_view head) {
  const Header header = read_header(head);
  if (header.detached) {
    throw_unusable(
        "Its samples are in another file (a pair of .hdr and .img); send the volume as one .nii.");
  }
  SourceVolume volume;
  volume.dims = dims_of(header);
  volume.layout = {type_of(header), header.big_endian, rescale_of(header)};
  volume.encoding = Encoding::kRaw;
  volume.payload.offset = payload_offset(header);
  volume.geometry = lps_geometry(header, volume.dims);
  return volume;
}

}  // namespace

bool is_nifti(std::string_view head) { return kind_of(head).has_value(); }

SourceVolume parse_nifti(const InputFile& file, const Companions& /*companions*/) {
  return describe(file.text(0, kNifti2Bytes));
}

std::uint64_t most_nifti_bytes(const InputFile& file, const SizeLimits& limits) {
  const std::string head = file.text(0, kSniffBytes);
  const SourceVolume volume = describe(inflate_head(std::as_bytes(std::span(head)), kNifti2Bytes));
  check_limits(volume, limits);
  return volume.payload.offset + volume.stored_bytes() + kHeadroomBytes;
}

}  // namespace isomesh::import
