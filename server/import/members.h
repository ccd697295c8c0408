// The one volume that an archive holds.
#pragma once

#include <cstdint>
#include <string_view>

#include "server/import/source/reader.h"

namespace isomesh::import {

bool is_archive(std::string_view head);

// Unpacks the archive and reads what it holds: one file of a volume, with the files beside it that
// its header may name, or any number of DICOM files. Other files, archives among them, are ignored.
// Throws Error kUnsupportedMedia when it holds no volume, kUnusableVolume when it holds several, or
// no volume but another archive, and whatever unpacking and reading throw.
Volume parse_archive(const Input& input);

// How many bytes a compressed TAR of this size may inflate to.
std::uint64_t most_archive_bytes(std::uint64_t compressed_bytes, const SizeLimits& limits);

}  // namespace isomesh::import
