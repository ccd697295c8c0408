#pragma once

#include <cstdint>
#include <string_view>

#include "server/import/source/reader.h"

namespace isomesh::import {

bool is_archive(std::string_view head);

// Unpacks the archive and reads one volume file, with the data files of its header, or any number
// of DICOM files. Other files, also nested archives, are ignored. Throws Error kUnsupportedMedia if
// it has no volume; kUnusableVolume if it has several, or only another archive; and all errors of
// unpacking and reading.
Volume parse_archive(const Input& input);

// The largest inflated size of a compressed TAR of this size.
std::uint64_t most_archive_bytes(std::uint64_t compressed_bytes, const SizeLimits& limits);

}  // namespace isomesh::import
