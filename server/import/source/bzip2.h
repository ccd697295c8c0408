// Decompresses bzip2 streams with bounded memory and output.
#pragma once

#include <cstdint>

#include "server/import/source/gzip.h"

namespace isomesh::import {

// As inflate_range, for one bzip2 stream or several consecutive ones.
std::uint64_t unzip2_range(const InputFile& file, const CompressedRange& range, std::uint64_t limit,
                           const ByteSink& sink);

}  // namespace isomesh::import
