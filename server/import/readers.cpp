#include "server/import/readers.h"

#include <algorithm>

#include "proto/error.h"
#include "server/import/dicom/import.h"
#include "server/import/formats/format_readers.h"
#include "server/import/images/page.h"
#include "server/import/images/stack.h"
#include "server/import/images/tiff.h"
#include "server/import/labels_beside.h"
#include "server/import/members.h"
#include "server/import/samples/transfer.h"
#include "server/import/source/gzip.h"

namespace isomesh::import {
namespace {

// For formats with a header.
template <SourceVolume (*kParse)(const InputFile&, const Companions&, const ImportOptions&)>
Volume parse_with(const Input& input) {
  const InputFile file(input.path);
  const ImportTask& task = input.task;
  Volume volume = write_canonical(file, kParse(file, input.companions, task.options), task);
  take_labels_beside(input.companions, volume);
  return volume;
}

// For formats that are read as a whole.
template <Volume (*kParse)(const Input&)>
Volume parse_whole(const Input& input) {
  Volume volume = kParse(input);
  take_labels_beside(input.companions, volume);
  return volume;
}

// For a header in front of its samples: the size of both. Formats with more data behind the samples
// get more room.
template <SourceVolume (*kParse)(const InputFile&, const Companions&, const ImportOptions&)>
MostBytes most_plain_bytes(const InputFile& beginning, const ImportTask& task) {
  constexpr std::uint64_t kFooterBytes = std::uint64_t{16} << 20;
  const Companions none;
  const SourceVolume volume = kParse(beginning, none, task.options);
  check_limits(volume, task.limits);
  return {.file = volume.payload.offset + volume.most_encoded_bytes() + kHeadroomBytes +
                  (volume.has_footer ? kFooterBytes : 0)};
}

constexpr Reader kRaw = {.name = "raw", .parse = parse_raw};

constexpr Reader kReaders[] = {
    kRaw,
    {.name = "nifti",
     .sniff = is_nifti,
     .parse = parse_with<parse_nifti>,
     .most_bytes = most_nifti_bytes,
     .data_names = nifti_data_names},
    {.name = "nrrd",
     .sniff = is_nrrd,
     .parse = parse_with<parse_nrrd>,
     .most_bytes = most_nrrd_bytes,
     .data_names = nrrd_data_names},
    {.name = "metaimage",
     .sniff = is_metaimage,
     .parse = parse_with<parse_metaimage>,
     .most_bytes = most_metaimage_bytes,
     .data_names = metaimage_data_names},
    {.name = "vti",
     .sniff = is_vti,
     .may_hold_volume = may_hold_image,
     .parse = parse_with<parse_vti>,
     .most_bytes = most_vti_bytes},
    {.name = "vtk",
     .sniff = is_vtk_legacy,
     .may_hold_volume = may_hold_structured_points,
     .parse = parse_with<parse_vtk_legacy>,
     .most_bytes = most_vtk_legacy_bytes},
    {.name = "mgh",
     .sniff = is_mgh,
     .parse = parse_with<parse_mgh>,
     .most_bytes = most_plain_bytes<parse_mgh>},
    {.name = "afni",
     .sniff = is_afni,
     .parse = parse_with<parse_afni>,
     .most_bytes = most_afni_bytes,
     .data_names = afni_data_names},
    {.name = "par",
     .sniff = is_par,
     .parse = parse_with<parse_par>,
     .most_bytes = most_par_bytes,
     .data_names = par_data_names},
    {.name = "isq",
     .sniff = is_isq,
     .parse = parse_with<parse_isq>,
     .most_bytes = most_plain_bytes<parse_isq>},
    {.name = "mrc",
     .sniff = is_mrc,
     .parse = parse_with<parse_mrc>,
     .most_bytes = most_plain_bytes<parse_mrc>},
    {.name = "cube",
     .sniff = is_cube,
     .parse = parse_with<parse_cube>,
     .most_bytes = most_plain_bytes<parse_cube>},
    {.name = "numpy",
     .sniff = is_numpy,
     .may_hold_volume = may_hold_numpy_volume,
     .parse = parse_with<parse_numpy>,
     .most_bytes = most_plain_bytes<parse_numpy>},
    {.name = "hdf5",
     .sniff = is_hdf5,
     .parse = parse_whole<parse_hdf5>,
     .most_bytes = most_hdf5_bytes},
    // Before images: the preamble of a DICOM file may be the header of a TIFF file (PS3.10, 7.1).
    {.name = "dicom",
     .content = Content::kSlices,
     .sniff = is_dicom,
     .parse = parse_dicom,
     .most_bytes = most_dicom_bytes},
    {.name = "tiff",
     .content = Content::kPages,
     .sniff = is_tiff,
     .parse = parse_image,
     .most_bytes = most_image_bytes},
    {.name = "png",
     .content = Content::kPages,
     .sniff = is_png,
     .parse = parse_image,
     .most_bytes = most_image_bytes},
    {.name = "bmp",
     .content = Content::kPages,
     .sniff = is_bmp,
     .parse = parse_image,
     .most_bytes = most_image_bytes},
    {.name = "archive", .content = Content::kFiles, .sniff = is_archive, .parse = parse_archive},
};

const Reader* sniff_plain(std::string_view head) {
  const auto* found = std::ranges::find_if(kReaders, [&](const Reader& reader) {
    return reader.sniff != nullptr && reader.sniff(head);
  });
  return found == std::end(kReaders) ? nullptr : found;
}

bool is_compressed(const InputFile& file) { return is_gzip(file.text(0, kSniffBytes)); }

void gunzip(const InputFile& file, std::uint64_t limit, ScratchFile& target) {
  const std::uint64_t bytes =
      inflate_range(file, {0, file.size()}, limit,
                    [&](std::span<const std::byte> piece) { target.write(piece); });
  if (bytes > limit) {
    throw_unusable("The compressed file unpacks to more than the " + std::to_string(limit) +
                   " bytes that its volume can have.");
  }
}

Volume parse(const Reader& reader, const Input& input) {
  Volume volume = reader.parse(input);
  if (reader.content != Content::kFiles) volume.format = reader.name;
  return volume;
}

void tell(const Reader& reader, const Input& input) {
  if (input.listener) input.listener(reader.name);
}

// The inflated beginning of a compressed file, in a file of its own.
class InflatedBeginning {
 public:
  InflatedBeginning(const InputFile& file, const std::filesystem::path& scratch)
      : scratch_(scratch, ".beginning") {
    const std::string plain = inflate_head(file.text(0, kBeginningBytes), kBeginningBytes);
    scratch_.write(std::as_bytes(std::span(plain)));
  }

  InputFile file() const { return InputFile(scratch_.path()); }

 private:
  ScratchFile scratch_;
};

// The largest inflated size of a compressed file; larger ones are rejected as bombs.
std::uint64_t most_inflated_bytes(const Reader& reader, const InputFile& file,
                                  const ImportTask& task) {
  if (reader.most_bytes == nullptr) return most_archive_bytes(file.size(), task.limits);
  const InflatedBeginning beginning(file, task.scratch);
  return reader.most_bytes(beginning.file(), task).file;
}

void check_options(const Reader& reader, const ImportOptions& options) {
  const bool is_volume = reader.content == Content::kVolume;
  if (is_volume && !options.series.empty()) {
    throw invalid_parameter("series", "selects a DICOM series, but this file is not DICOM");
  }
  if (options.nifti_form && reader.content != Content::kFiles && reader.name != "nifti") {
    throw invalid_parameter("nifti_form", "applies to NIfTI files, but this file is not NIfTI");
  }
}

}  // namespace

std::span<const Reader> readers() { return kReaders; }

const Reader* sniff(std::string_view head) {
  if (is_gzip(head)) return sniff_plain(inflate_head(head, kSniffBytes));
  return sniff_plain(head);
}

const Reader* sniff(const InputFile& file) { return sniff(file.text(0, kSniffBytes)); }

MostBytes most_bytes_of(const Reader& reader, const InputFile& beginning, const ImportTask& task) {
  if (!is_compressed(beginning)) return reader.most_bytes(beginning, task);
  const InflatedBeginning plain(beginning, task.scratch);
  MostBytes most = reader.most_bytes(plain.file(), task);
  // Deflate stores incompressible data with a few extra bytes per block.
  constexpr std::uint64_t kStoredShare = 100;
  most.file += most.file / kStoredShare;
  return most;
}

std::vector<std::string> data_names_of(const Reader& reader, const InputFile& beginning,
                                       const Companions& companions, const ImportTask& task) {
  if (reader.data_names == nullptr) return {};
  if (!is_compressed(beginning)) return reader.data_names(beginning, companions);
  const InflatedBeginning plain(beginning, task.scratch);
  return reader.data_names(plain.file(), companions);
}

Volume read_input(const Reader& reader, Input input) {
  tell(reader, input);
  check_options(reader, input.task.options);
  const InputFile file(input.path);
  if (!is_compressed(file)) return parse(reader, input);
  const std::uint64_t most = most_inflated_bytes(reader, file, input.task);
  ScratchFile plain(input.task.scratch, ".plain");
  gunzip(file, most, plain);
  input.path = plain.path();
  return parse(reader, input);
}

Volume read_raw_input(const Input& input) {
  tell(kRaw, input);
  return parse(kRaw, input);
}

}  // namespace isomesh::import
