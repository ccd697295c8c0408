// NIfTI-1 and NIfTI-2 headers (https://nifti.nimh.nih.gov/nifti-1, /nifti-2).
//
// Read here and not by ITK, because ITK 5.2 reads no NIfTI-2, crashes on small 5-D files, leaves
// the spatial unit out of the origin and the directions, takes the qform without a word where the
// sform is sheared or far from the origin, and turns 32-bit integers with a slope into floats.
#pragma once

#include <string_view>

#include "server/volume/source.h"

namespace isomesh::volume {

// How many leading bytes of a file hold its header.
inline constexpr std::size_t kNiftiHeaderBytes = 540;

bool is_nifti(std::string_view head);

// Reads the header. The payload's size stays 0: it is the file's. Throws Error kUnusableVolume.
//
// The geometry is the sform's where the file has one and it is the scanner's (code 1), or the only
// one, or agrees with the qform; otherwise the qform's: as ITK chooses, except that a sheared sform
// is as good as any other. A sform whose steps are not as long as the voxel sizes in `pixdim` is
// refused. Without either, the samples lie at (0,0,0) along LPS axes, as ITK has it.
SourceVolume parse_nifti(std::string_view head);

}  // namespace isomesh::volume
