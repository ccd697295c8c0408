// Philips' PAR/REC: a header .PAR with its samples in .REC. Versions 4, 4.1 and 4.2.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/files.h"
#include "server/import/source/reader.h"
#include "server/import/source/source.h"

namespace isomesh::import {

bool is_par(std::string_view head);

// Reads the header. Samples are the displayed values (DV = PV * RS + RI). The geometry is that of
// nibabel: from the angulation and the centre of the whole stack. The options select one of several
// echoes, instants, phases, types or diffusion weights. Throws Error kUnusableVolume.
SourceVolume parse_par(const InputFile& file, const Companions& companions,
                       const ImportOptions& options);

// The .REC beside the header.
std::vector<std::string> par_data_names(const InputFile& file, const Companions& companions);

// By the header. Throws as parse_par does, and Error kTooLarge beyond the limits.
MostBytes most_par_bytes(const InputFile& beginning, const ImportTask& task);

}  // namespace isomesh::import
