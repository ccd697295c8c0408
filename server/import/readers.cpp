#include "server/import/readers.h"

#include <algorithm>

#include "proto/error.h"
#include "server/import/archives/gzip.h"
#include "server/import/archives/import.h"
#include "server/import/dicom/import.h"
#include "server/import/formats/metaimage.h"
#include "server/import/formats/nifti.h"
#include "server/import/formats/nrrd.h"
#include "server/import/formats/raw.h"
#include "server/import/formats/vti.h"
#include "server/import/transfer.h"

namespace isomesh::import {
namespace {

// For the formats of which a header describes the samples.
template <SourceVolume (*kParse)(const InputFile&, const Companions&, const ImportOptions&)>
Volume parse_with(const Input& input) {
  const InputFile file(input.path);
  const ImportTask& task = input.task;
  return write_canonical(file, kParse(file, input.companions, task.options), task);
}

constexpr Reader kRaw = {.name = "raw", .title = "raw samples", .parse = parse_raw};

constexpr Reader kReaders[] = {
    kRaw,
    {.name = "nifti",
     .title = "NIfTI",
     .sniff = is_nifti,
     .parse = parse_with<parse_nifti>,
     .most_inflated_bytes = most_nifti_bytes,
     .data_names = nifti_data_names},
    {.name = "nrrd",
     .title = "NRRD",
     .sniff = is_nrrd,
     .parse = parse_with<parse_nrrd>,
     .most_inflated_bytes = most_nrrd_bytes,
     .data_names = nrrd_data_names},
    {.name = "metaimage",
     .title = "MetaImage",
     .sniff = is_metaimage,
     .parse = parse_with<parse_metaimage>,
     .most_inflated_bytes = most_metaimage_bytes,
     .data_names = metaimage_data_names},
    {.name = "vti", .title = "VTI", .sniff = is_vti, .parse = parse_with<parse_vti>},
    {.name = "dicom",
     .title = "DICOM",
     .content = Content::kSlices,
     .sniff = is_dicom,
     .parse = parse_dicom},
    {.name = "archive",
     .title = "a ZIP or TAR of one",
     .content = Content::kFiles,
     .sniff = is_archive,
     .parse = parse_archive,
     .most_inflated_bytes = most_archive_bytes},
};

const Reader* sniff_plain(std::string_view head) {
  const auto* found = std::ranges::find_if(kReaders, [&](const Reader& reader) {
    return reader.sniff != nullptr && reader.sniff(head);
  });
  return found == std::end(kReaders) ? nullptr : found;
}

bool is_compressed(const InputFile& file) {
  const std::string head = file.text(0, kSniffBytes);
  return is_gzip(std::as_bytes(std::span(head)));
}

void gunzip(const InputFile& file, std::uint64_t limit, ScratchFile& target) {
  const std::uint64_t bytes =
      inflate_range(file, {0, file.size()}, limit,
                    [&](std::span<const std::byte> piece) { target.write(piece); });
  if (bytes > limit) {
    throw_unusable("The compressed file holds more than the " + std::to_string(limit) +
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

// What chooses within files of another kind is a mistake.
void check_options(const Reader& reader, const ImportOptions& options) {
  const bool is_volume = reader.content == Content::kVolume;
  if (is_volume && !options.series.empty()) {
    throw invalid_parameter("series", "chooses among DICOM series, and this is no DICOM");
  }
  if (options.nifti_form && reader.content != Content::kFiles && reader.name != "nifti") {
    throw invalid_parameter("nifti_form", "is of NIfTI files, and this is none");
  }
}

}  // namespace

std::span<const Reader> readers() { return kReaders; }

const Reader* sniff(std::span<const std::byte> head) {
  if (is_gzip(head)) return sniff_plain(inflate_head(head, kSniffBytes));
  return sniff_plain({reinterpret_cast<const char*>(head.data()), head.size()});
}

const Reader* sniff(const InputFile& file) {
  const std::string head = file.text(0, kSniffBytes);
  return sniff(std::as_bytes(std::span(head)));
}

Volume read_input(const Reader& reader, Input input) {
  tell(reader, input);
  check_options(reader, input.task.options);
  const InputFile file(input.path);
  if (!is_compressed(file)) return parse(reader, input);
  const SizeLimits& limits = input.task.limits;
  const std::uint64_t most = reader.most_inflated_bytes != nullptr
                                 ? reader.most_inflated_bytes(file, limits, input.task.options)
                                 : limits.max_sample_bytes + kHeadroomBytes;
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
