#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string_view>

namespace isomesh::volume {

// kArchive is a ZIP or TAR, of whatever.
enum class FileFormat { kNifti, kNrrd, kMetaImage, kVti, kDicom, kArchive };

// The name that the API uses for the format: "nifti", "nrrd", "metaimage", "vti", "dicom";
// "archive" is none of a volume.
std::string_view to_string(FileFormat format);

// How many leading bytes are enough for `sniff`.
inline constexpr std::size_t kSniffBytes = 4096;

// Tells a file's format from its first bytes, looking into gzip; empty when it is none of ours.
// Never from a name. Thread safe.
std::optional<FileFormat> sniff(std::span<const std::byte> head);

}  // namespace isomesh::volume
