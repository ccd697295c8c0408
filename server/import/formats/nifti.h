// NIfTI-1 and NIfTI-2 headers (https://nifti.nimh.nih.gov/nifti-1, /nifti-2).
//
// ITK 5.2 is no model for all of this: it reads no NIfTI-2, crashes on small 5-D files, does not
// apply the spatial unit to the origin and the directions, silently takes the qform where the sform
// is sheared or far from the origin, and makes floats of 32-bit integers with a slope.
#pragma once

#include <cstdint>
#include <string_view>

#include "base/files.h"
#include "server/import/reader.h"
#include "server/import/source.h"

namespace isomesh::import {

bool is_nifti(std::string_view head);

// Reads the header. The payload's size stays 0, because the header does not tell it. Throws Error
// kUnusableVolume.
//
// The geometry is that of the sform where its code is the scanner's (1), where there is no qform,
// or where both agree; otherwise it is that of the qform. ITK chooses in the same way, but passes
// over a sheared sform. An sform whose steps are not as long as the voxel sizes in `pixdim` is
// refused. Without either form the samples begin at (0,0,0) and lie along the LPS axes, as in ITK.
SourceVolume parse_nifti(const InputFile& file, const Companions& companions);

// How many bytes a compressed file may inflate to, as its header tells. Throws Error kTooLarge for
// volumes beyond the limits.
std::uint64_t most_nifti_bytes(const InputFile& file, const SizeLimits& limits);

}  // namespace isomesh::import
