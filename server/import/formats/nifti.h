// NIfTI-1, NIfTI-2 and Analyze 7.5 headers (https://nifti.nimh.nih.gov/nifti-1, /nifti-2).
//
// ITK 5.2 is no model for all of this: it reads no NIfTI-2, crashes on small 5-D files, does not
// apply the spatial unit to the origin and the directions, silently takes the qform where the sform
// is sheared or far from the origin, and makes floats of 32-bit integers with a slope.
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

// Reads the header, attached to its samples or in a file of its own with an image file (.img)
// beside it. The payload's size stays 0, because the header does not tell it. Throws Error
// kUnusableVolume.
//
// The geometry is that of the sform where there is one, with its shear, and else that of the qform;
// the options may ask for either. A note tells where both disagree by more than a hundredth of a
// voxel, another where the sform's steps are not as long as the voxel sizes in `pixdim`. Without
// either form the samples begin at (0,0,0) and lie along the LPS axes, as in ITK; those of Analyze
// 7.5 lie as nibabel has them, with a note.
SourceVolume parse_nifti(const InputFile& file, const Companions& companions,
                         const ImportOptions& options);

// The file beside a header that holds its samples; none for one with its samples in it.
std::vector<std::string> nifti_data_names(const InputFile& file, const Companions& companions);

// As its header tells. Throws as parse_nifti does, and Error kTooLarge beyond the limits.
MostBytes most_nifti_bytes(const InputFile& beginning, const ImportTask& task);

}  // namespace isomesh::import
