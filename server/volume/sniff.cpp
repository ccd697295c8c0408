#include "server/volume/sniff.h"

#include <cstdint>
#include <cstring>
#include <string>

#include "server/volume/archive.h"
#include "server/volume/dicom/import.h"
#include "server/volume/gzip.h"
#include "server/volume/metaimage.h"
#include "server/volume/nifti.h"
#include "server/volume/nrrd.h"
#include "server/volume/vti.h"

namespace isomesh::volume {
namespace {

std::optional<FileFormat> sniff_plain(std::string_view head) {
  if (is_nifti(head)) return FileFormat::kNifti;
  if (is_nrrd(head)) return FileFormat::kNrrd;
  if (is_metaimage(head)) return FileFormat::kMetaImage;
  if (is_vti(head)) return FileFormat::kVti;
  if (is_dicom(std::as_bytes(std::span(head)))) return FileFormat::kDicom;
  if (is_zip(head) || is_tar(head)) return FileFormat::kArchive;
  return std::nullopt;
}

}  // namespace

std::string_view to_string(FileFormat format) {
  switch (format) {
    case FileFormat::kNifti:
      return "nifti";
    case FileFormat::kNrrd:
      return "nrrd";
    case FileFormat::kMetaImage:
      return "metaimage";
    case FileFormat::kVti:
      return "vti";
    case FileFormat::kDicom:
      return "dicom";
    case FileFormat::kArchive:
      return "archive";
  }
  return "";
}

std::optional<FileFormat> sniff(std::span<const std::byte> head) {
  if (is_gzip(head)) return sniff_plain(inflate_head(head, kSniffBytes));
  return sniff_plain({reinterpret_cast<const char*>(head.data()), head.size()});
}

}  // namespace isomesh::volume
