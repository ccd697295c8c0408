// NIfTI-1, NIfTI-2 and Analyze 7.5 headers (https://nifti.nimh.nih.gov/nifti-1, /nifti-2).
//
// ITK 5.2 is not the reference: it reads no NIfTI-2, crashes on small 5-D files, does not apply the
// spatial unit to the origin and the directions, silently uses the qform if the sform is sheared or
// far from the origin, and converts 32-bit integers with a slope to float.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/files.h"
#include "server/import/source/reader.h"
#include "server/import/source/source.h"

namespace isomesh::import {

bool is_nifti(std::string_view head);

// Reads the header, attached to its samples or with an image file (.img) beside it. The payload's
// size stays 0, because the header does not have it. Throws Error kUnusableVolume.
//
// The geometry is that of the sform, with its shear, otherwise that of the qform; the options may
// select either. A note reports forms that differ by more than a hundredth of a voxel, another one
// steps of the sform that differ from the voxel sizes in `pixdim`. Without either form the first
// sample is at (0,0,0) and the axes are those of LPS, as in ITK; Analyze 7.5 is placed as in
// nibabel, with a note.
SourceVolume parse_nifti(const InputFile& file, const Companions& companions,
                         const ImportOptions& options);

// The image file beside a detached header; none for an attached one.
std::vector<std::string> nifti_data_names(const InputFile& file, const Companions& companions);

// By the header. Throws as parse_nifti does, and Error kTooLarge beyond the limits.
MostBytes most_nifti_bytes(const InputFile& beginning, const ImportTask& task);

}  // namespace isomesh::import
