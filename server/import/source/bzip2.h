// Inflates bzip2 streams, with bounded memory and a bounded output.
#pragma once

#include <cstdint>

#include "server/import/source/gzip.h"

namespace isomesh::import {

// As inflate_range, for bzip2: one stream or several that follow one another.
std::uint64_t unzip2_range(const InputFile& file, const CompressedRange& range, std::uint64_t limit,
                           const ByteSink& sink);

}  // namespace isomesh::import
