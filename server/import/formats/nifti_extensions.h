// The extensions between a NIfTI header and the samples
// (https://nifti.nimh.nih.gov/nifti-1/documentation/nifti1fields/nifti1fields_pages/extension.html).
// Internal to the reader.
#pragma once

#include <cstdint>
#include <vector>

#include "base/files.h"
#include "proto/types.h"
#include "server/import/formats/nifti_header.h"

namespace isomesh::import {

// The labels of one of the file's volumes, as label_table() returns them: from Caret's LabelTable,
// which TotalSegmentator and others write too, or from AFNI's VALUE_LABEL_DTABLE. Other and damaged
// extensions are ignored, because their content is private to programs. `end` bounds the
// extensions. Throws Error kUnusableVolume if there are too many labels.
std::vector<LabelEntry> nifti_labels(const InputFile& file, const NiftiHeader& header,
                                     std::uint64_t end, std::uint64_t volume);

}  // namespace isomesh::import
