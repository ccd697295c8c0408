// AFNI datasets: a header .HEAD with its samples in .BRIK
// (https://afni.nimh.nih.gov/pub/dist/doc/program_help/README.attributes.html).
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/files.h"
#include "server/import/source/reader.h"
#include "server/import/source/source.h"

namespace isomesh::import {

bool is_afni(std::string_view head);

// Reads the header. IJK_TO_DICOM_REAL places the samples, otherwise ORIENT_SPECIFIC, ORIGIN and
// DELTA; AFNI's coordinates are LPS. The options select one of several sub-bricks, whose factor is
// applied. Throws Error kUnusableVolume.
SourceVolume parse_afni(const InputFile& file, const Companions& companions,
                        const ImportOptions& options);

// The .BRIK beside the header, maybe compressed.
std::vector<std::string> afni_data_names(const InputFile& file, const Companions& companions);

// By the header. Throws as parse_afni does, and Error kTooLarge beyond the limits.
MostBytes most_afni_bytes(const InputFile& beginning, const ImportTask& task);

}  // namespace isomesh::import
