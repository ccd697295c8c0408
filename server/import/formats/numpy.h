// NumPy's arrays, .npy
// (https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html). An .npz is a ZIP of
// them.
#pragma once

#include <string_view>

#include "base/files.h"
#include "server/import/source/reader.h"
#include "server/import/source/source.h"

namespace isomesh::import {

bool is_numpy(std::string_view head);

// True if the array has three or four axes of numbers. Other arrays beside it in an .npz are no
// volumes.
bool may_hold_numpy_volume(std::string_view head);

// Reads an array whose last three axes are z, y and x, as in SimpleITK, nnU-Net and PyTorch, in
// either memory order; a first of four axes holds several volumes. An array has neither a spacing
// nor a position. Throws Error kUnusableVolume.
SourceVolume parse_numpy(const InputFile& file, const Companions& companions,
                         const ImportOptions& options);

}  // namespace isomesh::import
