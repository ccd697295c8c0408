#include "server/volume/import.h"

#include <algorithm>
#include <optional>

#include "proto/error.h"
#include "server/volume/dicom.h"
#include "server/volume/files.h"
#include "server/volume/geometry.h"
#include "server/volume/gzip.h"
#include "server/volume/metaimage.h"
#include "server/volume/nifti.h"
#include "server/volume/nrrd.h"
#include "server/volume/payload.h"
#include "server/volume/sniff.h"
#include "server/volume/source.h"
#include "server/volume/transfer.h"

namespace isomesh::volume {
namespace {

// Room for headers, and for what some programs leave behind the samples.
constexpr std::uint64_t kHeadroomBytes = std::uint64_t{1} << 20;

FileFormat format_of(const std::string& head) {
  const auto format = sniff(std::as_bytes(std::span(head)));
  if (format) return *format;
  throw Error(ErrorCode::kUnsupportedMedia,
              "The file is not NIfTI, NRRD, MetaImage or DICOM; raw samples need dims and type.");
}

void check_limits(const SourceVolume& volume, const ImportLimits& limits) {
  check_limits(volume.sample_count(), canonical_type(volume.layout), limits);
}

// A header inside gzip tells how much there should be; a bomb is more.
std::uint64_t most_inflated_bytes(FileFormat format, const std::string& head,
                                  const ImportLimits& limits) {
  if (format != FileFormat::kNifti) return limits.max_sample_bytes + kHeadroomBytes;
  const SourceVolume volume =
      parse_nifti(inflate_head(std::as_bytes(std::span(head)), kNiftiHeaderBytes));
  check_limits(volume, limits);
  return volume.payload.offset + volume.stored_bytes() + kHeadroomBytes;
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

SourceVolume parse(FileFormat format, const InputFile& file, const std::filesystem::path& scratch) {
  switch (format) {
    case FileFormat::kNifti:
      return parse_nifti(file.text(0, kNiftiHeaderBytes));
    case FileFormat::kNrrd:
      return parse_nrrd(file, scratch);
    case FileFormat::kMetaImage:
      return parse_metaimage(file, scratch);
  }
  throw Error(ErrorCode::kInternal, "A format without a reader.");
}

Geometry usable_geometry(const SourceVolume& source) {
  const Geometry geometry = normalised(source.geometry);
  if (const auto fault = find_fault(source.dims, geometry)) {
    throw_unusable("The file's geometry cannot be used: " + fault->message + ".");
  }
  return geometry;
}

Volume import_plain(const InputFile& file, FileFormat format, const std::filesystem::path& scratch,
                    const ImportLimits& limits, const std::filesystem::path& target) {
  const SourceVolume source = parse(format, file, scratch);
  Volume volume;
  volume.format = to_string(format);
  volume.dims = source.dims;
  volume.geometry = usable_geometry(source);
  // A raw file that is too short is told so, whatever its header makes believe.
  if (source.encoding != Encoding::kRaw) check_limits(source, limits);
  const Payload payload(file, source, scratch);
  check_limits(source, limits);
  return write_canonical({payload.file(), payload.offset(), payload.layout()}, volume, target);
}

}  // namespace

Volume import_file(const std::filesystem::path& source, const std::string& series,
                   const std::filesystem::path& scratch, const ImportLimits& limits,
                   const std::filesystem::path& target) {
  const InputFile file(source);
  const std::string head = file.text(0, kSniffBytes);
  if (is_dicom(std::as_bytes(std::span(head)))) {
    return import_dicom(std::array{source}, "", limits, target);
  }
  const FileFormat format = format_of(head);
  if (!series.empty()) {
    throw invalid_parameter("series", "chooses among DICOM series, and this is no DICOM");
  }
  if (!is_gzip(std::as_bytes(std::span(head)))) {
    return import_plain(file, format, scratch, limits, target);
  }
  ScratchFile plain(scratch, ".plain");
  gunzip(file, most_inflated_bytes(format, head, limits), plain);
  return import_plain(InputFile(plain.path()), format, scratch, limits, target);
}

}  // namespace isomesh::volume
