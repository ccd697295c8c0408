#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "base/text.h"
#include "server/import/formats/format_readers.h"
#include "server/import/formats/nifti_forms.h"
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
    return row.type;
  }
  for (const Name& other : kOthers) {
    if (other.code != header.datatype) continue;
    throw_unusable(std::string("The samples are ") + other.name +
                   ". A sample must be one real number.");
  }
  throw_unusable("The NIfTI header's datatype " + std::to_string(header.datatype) + " is unknown.");
}

// A slope of 0 means none, and then the intercept does not apply; several programs write NaN.
std::optional<Rescale> rescale_of(const NiftiHeader& header, std::vector<Note>& notes) {
  if (header.slope == 0 || std::isnan(header.slope)) {
    if (header.intercept != 0 && std::isfinite(header.intercept)) {
      notes.push_back(note_of(NoteCode::kRescaleIgnored,
                              "The NIfTI header has an intercept of " + to_text(header.intercept) +
                                  ", but no slope. By the standard it does not apply then. ITK and "
                                  "some viewers add it to the samples."));
    }
    return std::nullopt;
  }
  if (!std::isfinite(header.slope) || !std::isfinite(header.intercept)) {
    throw_unusable("The slope " + to_text(header.slope) + " and intercept " +
                   to_text(header.intercept) + " of the samples are not finite numbers.");
  }
  if (header.slope == 1 && header.intercept == 0) return std::nullopt;
  return Rescale{header.slope, header.intercept};
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

// The fifth dimension has a matrix, a vector, a quaternion or a colour for each place.
bool has_components(const NiftiHeader& header) {
  constexpr std::array kIntents = {1004, 1005, 1006, 1007, 1010, 2003, 2004};
  return header.dim[0] >= 5 && std::ranges::find(kIntents, header.intent) != kIntents.end();
}

// Everything except the location of the samples.
SourceVolume describe(const NiftiHeader& header, const ImportOptions& options) {
  SourceVolume volume;
  check_intent(header);
  const std::vector<std::uint64_t> sizes = sizes_of(header);
  volume.dims = volume_dims(std::span(sizes).first(std::min<std::size_t>(sizes.size(), 3)));
  check_is_lattice(volume.dims);
  if (!header.corrections.empty()) {
    std::string all;
    for (const std::string& each : header.corrections) all += (all.empty() ? "" : " ") + each;
    volume.notes.push_back(corrected_note(all));
  }
  volume.layout = {type_of(header), header.big_endian, rescale_of(header, volume.notes)};
  std::uint64_t volumes = volumes_beyond(sizes);
  if (volumes > 1 && has_components(header)) {
    refuse_flat("The file", volume.dims);
  } else {
    const std::string axis = sizes.size() < 5     ? "its fourth dimension, time"
                             : header.dim[4] == 1 ? "its fifth dimension, of values"
                                                  : "its dimensions beyond the third";
    volumes = volumes_of_frames(volumes, axis, options, volume);
  }
  choose_volume(volumes, difference_of(header), options, volume);
  volume.are_labels = header.intent == kIntentLabel;
  volume.encoding = Encoding::kRaw;
  volume.geometry = nifti_geometry(header, options, volume);
  return volume;
}

// The image file of a pair has the header's name with another suffix.
std::optional<std::string> image_beside(const Companions& companions) {
  std::string_view own = companions.name();
  if (lower(own).ends_with(".gz")) own.remove_suffix(3);
  return companion_with({".img", ".img.gz", ".IMG"}, own, companions);
}

std::string image_name(const Companions& companions) {
  if (auto name = image_beside(companions)) return *std::move(name);
  throw_unusable(
      "The samples of the NIfTI header (.hdr) are in an .img file, which is missing. Send both "
      "files in one ZIP or "
      "TAR, or send the volume as one .nii file.");
}

// Some programs write the magic of a pair into a file that has its samples.
void attach_samples(const InputFile& file, const Companions& companions, NiftiHeader& header) {
  const bool has_more = header.vox_offset >= static_cast<double>(header.bytes) &&
                        static_cast<double>(file.size()) > header.vox_offset;
  if (!header.is_detached || header.is_analyze || !has_more || image_beside(companions)) {
    return;
  }
  header.is_detached = false;
  header.corrections.emplace_back(
      "Its magic is that of a pair of .hdr and .img, but the samples are in the same file.");
}

SourceVolume parse_nifti(const InputFile& file, const Companions& companions,
                         const ImportOptions& options) {
  NiftiHeader header = read_nifti_header(file.text(0, kNiftiHeaderBytes));
  attach_samples(file, companions, header);
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
  NiftiHeader header = read_nifti_header(file.text(0, kNiftiHeaderBytes));
  attach_samples(file, companions, header);
  if (!header.is_detached) return {};
  return {image_name(companions)};
}

MostBytes most_nifti_bytes(const InputFile& beginning, const ImportTask& task) {
  const NiftiHeader header = read_nifti_header(beginning.text(0, kNiftiHeaderBytes));
  const SourceVolume volume = describe(header, task.options);
  check_limits(volume, task.limits);
  const std::uint64_t samples =
      payload_offset(header) + volume.most_encoded_bytes() + kHeadroomBytes;
  return {.file = samples, .data = header.is_detached ? samples : 0};
}

}  // namespace

constinit const Reader kNiftiReader = {.name = "nifti",
                                       .sniff = begins_as_nifti,
                                       .describe = parse_nifti,
                                       .most_bytes = most_nifti_bytes,
                                       .data_names = nifti_data_names};

}  // namespace isomesh::import
