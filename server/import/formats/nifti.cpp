#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <optional>
#include <vector>

#include "base/text.h"
#include "server/import/formats/format_readers.h"
#include "server/import/formats/nifti_header.h"
#include "server/import/formats/placing.h"
#include "server/import/source/gzip.h"

namespace isomesh::import {
namespace {

std::vector<std::uint64_t> sizes_of(const NiftiHeader& header) {
  if (header.dim[0] < 1 || header.dim[0] > 7) {
    throw_unusable("The NIfTI header declares " + std::to_string(header.dim[0]) +
                   " dimensions. 1 to 7 are possible.");
  }
  std::vector<std::uint64_t> sizes;
  for (std::size_t axis = 1; axis <= static_cast<std::size_t>(header.dim[0]); ++axis) {
    if (header.dim[axis] < 0) {
      throw_unusable("The size along " + axis_name(axis - 1) + " is " +
                     std::to_string(header.dim[axis]) + ".");
    }
    sizes.push_back(static_cast<std::uint64_t>(header.dim[axis]));
  }
  return sizes;
}

// For an index along the axes beyond the third; the fourth is time and runs fastest.
std::string title_of(const NiftiHeader& header, std::uint64_t index) {
  const auto instants = static_cast<std::uint64_t>(std::max<std::int64_t>(header.dim[4], 1));
  const double step = header.pixdim[4];
  constexpr int kTimeUnits = 56;
  struct Row {
    int code;
    const char* name;
  };
  static constexpr Row kUnits[] = {{8, " s"}, {16, " ms"}, {24, " us"}, {32, " Hz"}, {40, " ppm"}};
  const auto* unit = std::ranges::find(kUnits, header.units & kTimeUnits, &Row::code);
  const std::uint64_t instant = index % instants;
  std::string title = "time " + std::to_string(instant);
  if (unit != std::end(kUnits) && std::isfinite(step) && step > 0) {
    title = to_text(step * static_cast<double>(instant)) + unit->name;
  }
  if (header.dim[0] < 5) return title;
  const std::string value = "value " + std::to_string(index / instants);
  return instants == 1 ? value : title + ", " + value;
}

Difference difference_of(const NiftiHeader& header) {
  const bool by_time = header.dim[4] > 1;
  const bool by_value = header.dim[0] >= 5;
  return {.what = by_time && by_value ? "time and dimension 5 (value)"
                  : by_value          ? "dimension 5 (value)"
                                      : "time",
          .title = [header](std::uint64_t index) { return title_of(header, index); }};
}

StoredType type_of(const NiftiHeader& header) {
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
                     " bits, but its bitpix is " + std::to_string(header.bits) + ".");
    }
    return row.type;
  }
  for (const Name& other : kOthers) {
    if (other.code != header.datatype) continue;
    throw_unusable(std::string("The samples are ") + other.name +
                   ". A sample must be one real number.");
  }
  throw_unusable("The NIfTI header's datatype " + std::to_string(header.datatype) + " is unknown.");
}

// A slope of 0 means none; several programs write NaN.
std::optional<Rescale> rescale_of(const NiftiHeader& header) {
  if (header.slope == 0 || std::isnan(header.slope)) return std::nullopt;
  if (!std::isfinite(header.slope) || !std::isfinite(header.intercept)) {
    throw_unusable("The slope " + to_text(header.slope) + " and intercept " +
                   to_text(header.intercept) + " of the samples are not finite numbers.");
  }
  if (header.slope == 1 && header.intercept == 0) return std::nullopt;
  return Rescale{header.slope, header.intercept};
}

double millimetres_per_unit(const NiftiHeader& header) {
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

bool is_length(double size) { return std::isfinite(size) && size > 0; }

// An axis with a single sample needs no spacing, and some programs write 0.
Vector3 spacing_of(const NiftiHeader& header, const std::array<std::uint32_t, 3>& dims) {
  Vector3 spacing;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    spacing[axis] = header.pixdim[axis + 1];
    if (dims[axis] == 1 && !(spacing[axis] > 0)) spacing[axis] = 1;
    if (is_length(spacing[axis])) continue;
    throw_unusable("The voxel size along " + axis_name(axis) + " is " + to_text(spacing[axis]) +
                   ", not a positive number.");
  }
  return spacing;
}

// Origin and steps in RAS and in the file's unit.
struct Placement {
  Vector3 origin = {};
  std::array<Vector3, 3> steps = {};
};

Placement sform_of(const NiftiHeader& header) {
  Placement placement;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      placement.steps[axis][row] = header.srow[row * 4 + axis];
    }
    placement.origin[row] = header.srow[row * 4 + 3];
  }
  return placement;
}

double squares_of(const NiftiHeader& header) {
  const auto& [b, c, d] = header.quaternion;
  return b * b + c * c + d * d;
}

bool is_rotation(const NiftiHeader& header) {
  constexpr double kRounding = 1e-3;
  return squares_of(header) <= 1 + kRounding;
}

// The quaternion has length 1 and a nonnegative real part, which is therefore not stored.
Placement qform_of(const NiftiHeader& header, const Vector3& spacing) {
  if (!is_rotation(header)) {
    throw_unusable("The quaternion of the NIfTI header's qform is not a rotation.");
  }
  auto [b, c, d] = header.quaternion;
  const double squares = squares_of(header);
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

Vector3 point_of(const Placement& placement, const std::array<double, 3>& index) {
  Vector3 point = placement.origin;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t row = 0; row < 3; ++row) {
      point[row] += placement.steps[axis][row] * index[axis];
    }
  }
  return point;
}

// The largest distance between the two positions of a sample, which is at a corner.
double distance_of(const Placement& one, const Placement& other,
                   const std::array<std::uint32_t, 3>& dims) {
  double most = 0;
  for (unsigned corner = 0; corner < 8; ++corner) {
    std::array<double, 3> index;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      index[axis] = (corner >> axis & 1U) != 0 ? dims[axis] - 1.0 : 0;
    }
    const Vector3 a = point_of(one, index);
    const Vector3 b = point_of(other, index);
    most = std::max(most, std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]));
  }
  return most;
}

double shortest_step(const Placement& placement) {
  double shortest = HUGE_VAL;
  for (const Vector3& step : placement.steps) {
    shortest = std::min(shortest, std::hypot(step[0], step[1], step[2]));
  }
  return shortest;
}

void note_other_pixdim(const NiftiHeader& header, const Placement& sform, SourceVolume& volume) {
  constexpr double kTolerance = 0.01;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Vector3& step = sform.steps[axis];
    const double size = std::hypot(step[0], step[1], step[2]);
    const double told = header.pixdim[axis + 1];
    const bool agrees = is_length(told) && std::abs(size - told) <= told * kTolerance;
    if (volume.dims[axis] == 1 || agrees) continue;
    volume.notes.push_back(
        note_of(NoteCode::kPixdimDiffers, "The NIfTI header gives two sizes for a voxel along " +
                                              axis_name(axis) + ": " + to_text(told) +
                                              " in its pixdim and " + to_text(size) +
                                              " in its sform. The sform was used."));
    return;
  }
}

Placement without_forms(const Vector3& spacing, SourceVolume& volume) {
  volume.notes.push_back(
      note_of(NoteCode::kSpaceAssumed,
              "The NIfTI header has neither an sform nor a qform (both codes are 0). The axes were "
              "read as those of LPS, with the first sample at (0,0,0)."));
  Placement placement;
  // The LPS axes, in RAS.
  placement.steps[0][0] = -spacing[0];
  placement.steps[1][1] = -spacing[1];
  placement.steps[2][2] = spacing[2];
  return placement;
}

// Many writers leave the field at 0 or at random, so nibabel and SPM ignore it, too.
std::string ignored_orient(int orient) {
  static constexpr const char* kNames[] = {"",
                                           "coronal unflipped",
                                           "sagittal unflipped",
                                           "transverse flipped",
                                           "coronal flipped",
                                           "sagittal flipped"};
  if (orient < 1 || orient >= static_cast<int>(std::size(kNames))) return {};
  return " Its field \"orient\", " + std::to_string(orient) + " (" + kNames[orient] +
         "), was ignored because many programs do not set it correctly.";
}

// Analyze's axes run left, front and up, and its images are centred, as programs that read them
// assume.
Placement analyze_placement(const NiftiHeader& header, const Vector3& spacing,
                            SourceVolume& volume) {
  volume.notes.push_back(
      note_of(NoteCode::kSpaceAssumed,
              "An Analyze header does not say how its axes lie in the patient. The axes were "
              "assumed to run to the left, to the front and up, with (0,0,0) in the middle." +
                  ignored_orient(header.analyze_orient)));
  Placement placement;
  placement.steps[0][0] = -spacing[0];
  placement.steps[1][1] = spacing[1];
  placement.steps[2][2] = spacing[2];
  for (std::size_t axis = 0; axis < 3; ++axis) {
    placement.origin[axis] = -placement.steps[axis][axis] * (volume.dims[axis] - 1.0) / 2;
  }
  return placement;
}

void note_other_form(const NiftiHeader& header, const Placement& taken, const Placement& other,
                     const std::string& name_of_taken, SourceVolume& volume) {
  constexpr double kVoxels = 0.01;
  const std::string name_of_other = name_of_taken == "sform" ? "qform" : "sform";
  const double apart = distance_of(taken, other, volume.dims);
  if (apart <= shortest_step(taken) * kVoxels) return;
  std::array<char, 32> millimetres = {};
  std::snprintf(millimetres.data(), millimetres.size(), "%.1f",
                apart * millimetres_per_unit(header));
  volume.notes.push_back(
      note_of(NoteCode::kFormsDiffer, std::string("The sform and qform of the NIfTI header place "
                                                  "samples up to ") +
                                          millimetres.data() + " mm apart. The " + name_of_taken +
                                          " was used. nifti_form=" + name_of_other +
                                          " selects the " + name_of_other + "."));
}

Placement placement_of(const NiftiHeader& header, const ImportOptions& options,
                       SourceVolume& volume) {
  const bool has_sform = header.sform_code > 0;
  const bool has_qform = header.qform_code > 0;
  const auto asked = options.nifti_form;
  if (asked && !(*asked == NiftiForm::kSform ? has_sform : has_qform)) {
    throw_unusable("The NIfTI header has no " + std::string(to_string(*asked)) +
                   ", which nifti_form selects.");
  }
  const bool takes_sform = asked ? *asked == NiftiForm::kSform : has_sform;
  const bool has_sizes =
      std::all_of(header.pixdim.begin() + 1, header.pixdim.begin() + 4, is_length);
  if (!takes_sform) {
    const Vector3 spacing = spacing_of(header, volume.dims);
    if (header.is_analyze) return analyze_placement(header, spacing, volume);
    if (!has_qform) return without_forms(spacing, volume);
    const Placement qform = qform_of(header, spacing);
    if (has_sform) note_other_form(header, qform, sform_of(header), "qform", volume);
    return qform;
  }
  const Placement sform = sform_of(header);
  note_other_pixdim(header, sform, volume);
  if (has_qform && has_sizes && is_rotation(header)) {
    note_other_form(header, sform, qform_of(header, spacing_of(header, volume.dims)), "sform",
                    volume);
  }
  return sform;
}

Geometry lps_geometry(const NiftiHeader& header, const ImportOptions& options,
                      SourceVolume& volume) {
  auto [origin, steps] = placement_of(header, options, volume);
  const double scale = millimetres_per_unit(header);
  for (Vector3* vector : {&origin, &steps[0], &steps[1], &steps[2]}) {
    for (double& part : *vector) part *= scale;
  }
  return geometry_of_ras(origin, steps);
}

std::uint64_t payload_offset(const NiftiHeader& header) {
  // Header extensions are small; a larger offset is corrupt.
  constexpr double kMost = 64 << 20;
  const double least = header.is_detached ? 0 : static_cast<double>(header.bytes);
  if (!(header.vox_offset >= least && header.vox_offset <= kMost) ||
      header.vox_offset != std::floor(header.vox_offset)) {
    throw_unusable("The NIfTI header's vox_offset is " + to_text(header.vox_offset) +
                   ", which is not a possible position of the samples.");
  }
  return static_cast<std::uint64_t>(header.vox_offset);
}

// CIFTI-2 keeps values of vertices and voxels as a matrix in the fifth and sixth dimension.
void check_intent(const NiftiHeader& header) {
  constexpr int kFirstOfCifti = 3000;
  constexpr int kLastOfCifti = 3099;
  if (header.intent < kFirstOfCifti || header.intent > kLastOfCifti) return;
  throw_unusable(
      "This is a CIFTI-2 file: a matrix of values of a brain's vertices and voxels, not a volume.");
}

// NIFTI_INTENT_LABEL.
constexpr int kIntentLabel = 1002;

// Everything except the location of the samples.
SourceVolume describe(const NiftiHeader& header, const ImportOptions& options) {
  SourceVolume volume;
  check_intent(header);
  const std::vector<std::uint64_t> sizes = sizes_of(header);
  volume.dims = volume_dims(std::span(sizes).first(std::min<std::size_t>(sizes.size(), 3)));
  check_is_lattice(volume.dims);
  volume.layout = {type_of(header), header.big_endian, rescale_of(header)};
  const std::uint64_t volumes = volumes_of_frames(volumes_beyond(sizes), options, volume);
  choose_volume(volumes, difference_of(header), options, volume);
  volume.are_labels = header.intent == kIntentLabel;
  volume.encoding = Encoding::kRaw;
  volume.geometry = lps_geometry(header, options, volume);
  return volume;
}

// The image file of a pair has the header's name with another suffix.
std::string image_name(const Companions& companions) {
  std::string_view own = companions.name();
  if (lower(own).ends_with(".gz")) own.remove_suffix(3);
  if (const auto name = companion_with({".img", ".img.gz", ".IMG"}, own, companions)) return *name;
  throw_unusable(
      "The samples of the NIfTI header (.hdr) are in an .img file, which is missing. Send both "
      "files in one ZIP or "
      "TAR, or send the volume as one .nii file.");
}

SourceVolume parse_nifti(const InputFile& file, const Companions& companions,
                         const ImportOptions& options) {
  const NiftiHeader header = read_nifti_header(file.text(0, kNiftiHeaderBytes));
  // A missing image file is reported before all other errors.
  const std::string image = header.is_detached ? image_name(companions) : "";
  SourceVolume volume = describe(header, options);
  const std::uint64_t end = header.is_detached ? file.size() : payload_offset(header);
  volume.labels = nifti_labels(file, header, end, volume.chosen.index);
  if (!header.is_detached) {
    volume.payload.offset = end;
    return volume;
  }
  const InputFile samples(companion(image, companions));
  if (is_gzip(samples.text(0, kSniffBytes))) volume.encoding = Encoding::kDeflate;
  volume.data_files = data_files_of({image}, companions, {.bytes = payload_offset(header)}, volume);
  return volume;
}

std::vector<std::string> nifti_data_names(const InputFile& file, const Companions& companions) {
  const NiftiHeader header = read_nifti_header(file.text(0, kNiftiHeaderBytes));
  if (!header.is_detached) return {};
  return {image_name(companions)};
}

MostBytes most_nifti_bytes(const InputFile& beginning, const ImportTask& task) {
  const NiftiHeader header = read_nifti_header(beginning.text(0, kNiftiHeaderBytes));
  const SourceVolume volume = describe(header, task.options);
  check_limits(volume, task.limits);
  const std::uint64_t samples =
      payload_offset(header) + volume.most_encoded_bytes() + kHeadroomBytes;
  if (header.is_detached) return {.file = kHeadroomBytes, .data = samples};
  return {.file = samples};
}

}  // namespace

constinit const Reader kNiftiReader = {.name = "nifti",
                                       .sniff = begins_as_nifti,
                                       .describe = parse_nifti,
                                       .most_bytes = most_nifti_bytes,
                                       .data_names = nifti_data_names};

}  // namespace isomesh::import
